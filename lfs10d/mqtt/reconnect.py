"""When the next connection is tried, and in which version. Pure: time and chance are arguments.

- A connection that held is renewed at once; then after 1, 2, 4 ... 30 s, each shortened by chance by up to a
  quarter, so that a hundred gateways do not come back in step.
- Each round begins with the configured version. A broker that refuses 5, or does not answer, is asked in
  3.1.1 at once: some old brokers say nothing. A refusal is not remembered, because a broker may be replaced by a
  better one. But one that has spoken 5 and says nothing now is stalled, or still starting behind a forwarder: it is
  asked in 5 again, for 3.1.1 would last as long as that connection and hide every reason code.
- Taken over by a client with our id, we wait 60 s, doubling to 1 h, until a connection has held for 2 h. Not
  every broker says so (by 3.1.1 none can, mosquitto 2.0.11 does not). So the third connection in a row that
  does not hold is taken for that, if no attempt failed between them and the broker itself ended those before:
  then it had published our will when we came back. A broker that was restarted has not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from lfs10d.mqtt.endings import Ending
from lfs10d.mqtt.settings import Version

if TYPE_CHECKING:
    from collections.abc import Callable

    from lfs10d.mqtt.endings import Ended

FIRST_DELAY = 1.0
LONGEST_DELAY = 30.0
"""Seconds between two attempts."""

JITTER = 0.25
"""The part of a delay that chance may take away."""

HELD = 10.0
"""Seconds after which a connection counts as one that held."""

TAKEN_OVER_FIRST = 60.0
TAKEN_OVER_LONGEST = 3600.0
TAKEN_OVER_FORGOTTEN = 7200.0
"""Seconds (contract, section 3); the last is longer than the other side can be waiting."""

SHORT_MOST = 3
"""This many connections in a row that the broker ended before they held are another client with our id."""

SILENT_MOST = 20
"""This many times in a row, about ten minutes, a broker that has spoken 5 may say nothing before 3.1.1 is tried."""


@dataclass(slots=True)
class Reconnect:
    """The policy; `chance()` is uniform in 0..1."""

    configured: Version
    chance: Callable[[], float]
    version: Version = Version.V5
    """What is tried next."""
    due: float = float("-inf")
    """When it is tried, monotonic seconds."""
    duplicate: bool = False
    """Another client uses our id."""
    _delay: float = FIRST_DELAY
    _takeover: float = TAKEN_OVER_FIRST
    _since: float | None = None
    _short: int = 0
    _unproved: bool = False
    _silent: int | None = None
    """How often in a row a broker that has spoken 5 said nothing; None: it never has."""

    def __post_init__(self) -> None:
        self.version = self.configured

    def accepted(self, now: float) -> None:
        """Note that the connection stands."""
        self._since = now
        if self.version is Version.V5:
            self._silent = 0

    def missed(self) -> None:
        """Note that the broker had published our will: it lives, and ended the last connection itself."""
        self._short += self._unproved
        self._unproved = False

    def held(self, now: float) -> None:
        """Forget a duplicate once the connection has held for as long as the other side may be waiting."""
        if self._since is not None and now - self._since >= self._takeover:
            self.duplicate = False

    def ended(self, ended: Ended, now: float) -> None:
        """Note how the connection or the attempt ended, and decide on the next."""
        version, self.version = self.version, self.configured
        self.held(now)
        since, self._since = self._since, None
        if since is not None:
            self._lost(ended, now - since, now)
        elif version is Version.V5 and self._refuses_five(ended):
            self.version = Version.V311
            self.due = now
        else:
            self._short = 0
            self._unproved = False
            self._later(now)

    def _refuses_five(self, ended: Ended) -> bool:
        """Tell whether 3.1.1 is worth a try, and count the silence of a broker that can do better."""
        if ended.ending is not Ending.WRONG_VERSION:
            return False
        if self._silent is None or ended.reason is not None:
            return True
        self._silent += 1
        if self._silent <= SILENT_MOST:
            return False
        self._silent = None
        return True

    def _lost(self, ended: Ended, life: float, now: float) -> None:
        if life >= TAKEN_OVER_FORGOTTEN:
            self._takeover = TAKEN_OVER_FIRST
        self._unproved = life < HELD
        if not self._unproved:
            self._short = 0
        suspect = self._unproved and self._short >= SHORT_MOST - 1
        if ended.ending is Ending.TAKEN_OVER or suspect:
            self.duplicate = True
            self.due = now + self._takeover
            self._takeover = min(2 * self._takeover, TAKEN_OVER_LONGEST)
        elif life >= HELD:
            self._delay = FIRST_DELAY
            self.due = now
        else:
            self._later(now)

    def _later(self, now: float) -> None:
        self.due = now + self._delay * (1 - JITTER * self.chance())
        self._delay = min(2 * self._delay, LONGEST_DELAY)
