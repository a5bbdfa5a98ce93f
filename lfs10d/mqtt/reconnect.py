"""Decides when the next connection is tried, to which node, and in which version. Pure: time and chance are arguments.

- A connection that held is renewed at once, with the same node. A node that is not there (no name, no route, no
  answer, port closed) is tried every second, shortened by chance by up to a quarter, so that a hundred gateways do
  not come back in step: when it returns we are back. A node that refuses us, or drops us before a connection has
  held, is tried after 1, 2, 4 ... 30 s, shortened likewise.
- Where there are several nodes, each has its own time. They are tried together, in turn, each when its time has
  come (`node_race`): the first that answers is taken, and kept if it accepts us. After a failure the next whose time
  has come is tried at once.
- Each round begins with the configured version. A broker that refuses 5, or does not answer, is asked in
  3.1.1 at once: some old brokers say nothing. A refusal is not remembered, because a broker may be replaced by a
  better one. But one that has spoken 5 and says nothing now is stalled, or still starting behind a forwarder: it is
  asked in 5 again, for 3.1.1 would last as long as that connection and hide every reason code.
- One that has accepted us and now says nothing, or closes the connection without a word, is for 10 min taken for one
  that is not there; after that, for one that refuses us.
- Taken over by a client with our id, we wait 60 s, doubling to 1 h, until a connection has held for 2 h. Not
  every broker says so (by 3.1.1 none can, mosquitto 2.0.11 does not). So the third connection in a row that
  does not hold is taken for that, if no attempt failed between them and the broker itself ended those before:
  then it had published our will when we came back. A broker that was restarted has not. Nor is it that where the
  broker gave another reason, or where the same message was under way at the end before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import field

from lfs10d.mqtt.reasons import Disconnect, DisconnectReason
from lfs10d.mqtt.settings import Version
from lfs10d.system.dataclass import dataclass

AWAY_EVERY = 1.0
"""Seconds from the beginning of one attempt to the next where a node is not there."""

ATTEMPT_MOST = 5.0
"""Seconds that a node may take to answer."""

FIRST_DELAY = 1.0
LONGEST_DELAY = 30.0
"""Seconds between two attempts where a node refuses us."""

JITTER = 0.25
"""Random part of a delay."""

HELD = 10.0
"""Seconds after which a connection counts as one that held."""

TAKEN_OVER_FIRST = 60.0
TAKEN_OVER_LONGEST = 3600.0
TAKEN_OVER_FORGOTTEN = 7200.0
"""Seconds (contract, section 3); the last is longer than the other side can be waiting."""

SHORT_MOST = 3
"""This many connections in a row that the broker ended before they held are another client with our id."""

SILENT_FOR = 600.0
"""Seconds for which a node that has accepted us may say nothing before it is taken for another broker."""


_WORDLESS = frozenset({DisconnectReason.WRONG_VERSION, DisconnectReason.CLOSED})
"""The connection was made, and ended without a reason code."""


@dataclass(slots=True)
class _Node:
    """One node; `due` is the earliest time of its next attempt."""

    due: float = float("-inf")
    delay: float = FIRST_DELAY
    accepted: bool = False
    """It has accepted us once."""
    spoke_five: bool = False
    silent_since: float | None = None
    """It has said nothing, or closed without a word, since then."""


@dataclass(slots=True)
class Reconnect:
    """The policy; `chance()` is uniform in 0..1, `nodes` is how many there are."""

    configured: Version
    chance: Callable[[], float]
    nodes: int = 1
    version: Version = Version.V5
    """What is tried next."""
    node: int = 0
    """Which node is tried next, or is connected: 0 is the first."""
    due: float = float("-inf")
    """When it is tried, monotonic seconds."""
    duplicate: bool = False
    """Another client uses our id."""
    _takeover: float = TAKEN_OVER_FIRST
    _begun: float = float("-inf")
    _since: float | None = None
    _short: int = 0
    _unproved: bool = False
    _all: list[_Node] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.version = self.configured
        self._all = [_Node() for _ in range(self.nodes)]

    @property
    def _current(self) -> _Node:
        return self._all[self.node]

    def begun(self, now: float) -> None:
        """Note that an attempt begins."""
        self._begun = now

    def beside(self, now: float) -> tuple[tuple[int, float], ...]:
        """Return the nodes that are tried together with `node`, in turn, each with the seconds until its time comes.

        None while `node` is asked in 3.1.1 instead; none whose time comes only when this attempt is over.
        """
        if self.version is not self.configured:
            return ()
        in_turn = [(self.node + step) % self.nodes for step in range(1, self.nodes)]
        waits = [(each, max(0.0, self._all[each].due - now)) for each in in_turn]
        return tuple(sorted((each for each in waits if each[1] < ATTEMPT_MOST), key=lambda each: each[1]))

    def opened(self, node: int) -> None:
        """Note that of the nodes tried this one answers."""
        self.node = node

    def unreached(self, nodes: Iterable[int], now: float) -> None:
        """Note that these nodes, tried together with `node`, did not answer either; `ended` follows."""
        for each in nodes:
            self._all[each].delay = FIRST_DELAY
            self._all[each].silent_since = None
            self._all[each].due = max(now, self._begun + AWAY_EVERY * self._shortened())

    def accepted(self, now: float) -> None:
        """Note that the connection stands."""
        self._since = now
        self._current.accepted = True
        self._current.silent_since = None
        if self.version is Version.V5:
            self._current.spoke_five = True

    def missed(self) -> None:
        """Note that the broker had published our will: it lives, and ended the last connection itself."""
        self._short += self._unproved
        self._unproved = False

    def held(self, now: float) -> None:
        """Forget a duplicate once the connection has held for as long as the other side may be waiting."""
        if self._since is not None and now - self._since >= self._takeover:
            self.duplicate = False

    def ended(self, ended: Disconnect, now: float, *, explained: bool = False) -> None:
        """Note how the connection or the attempt ended, and decide on the next.

        `explained`: a message of ours may be why the broker ended it.
        """
        version, self.version = self.version, self.configured
        self.held(now)
        since, self._since = self._since, None
        if since is not None:
            self._lost(ended, now - since, now, explained=explained or ended.reason is not None)
        else:
            self._failed(ended, version, now)

    def _failed(self, ended: Disconnect, version: Version, now: float) -> None:
        absent = self._absent(ended, now)
        if (
            version is Version.V5
            and ended.ending is DisconnectReason.WRONG_VERSION
            and not (absent and self._current.spoke_five)
        ):
            self._current.spoke_five = False
            self.version = Version.V311
            self.due = now
            return
        self._short = 0
        self._unproved = False
        if absent:
            self._current.delay = FIRST_DELAY
            self._current.due = max(now, self._begun + AWAY_EVERY * self._shortened())
        else:
            self._back_off(now)
        self._choose(now)

    def _absent(self, ended: Disconnect, now: float) -> bool:
        """Return whether the node is away, rather than refusing us."""
        node = self._current
        if ended.ending not in _WORDLESS or ended.reason is not None:
            node.silent_since = None
            return ended.ending is DisconnectReason.UNREACHABLE
        if node.silent_since is None:
            node.silent_since = now
        return node.accepted and now - node.silent_since <= SILENT_FOR

    def _lost(self, ended: Disconnect, life: float, now: float, *, explained: bool) -> None:
        if life >= TAKEN_OVER_FORGOTTEN:
            self._takeover = TAKEN_OVER_FIRST
        self._unproved = life < HELD and not explained
        if not self._unproved:
            self._short = 0
        suspect = self._unproved and self._short >= SHORT_MOST - 1
        if ended.ending is DisconnectReason.TAKEN_OVER or suspect:
            self.duplicate = True
            self.due = now + self._takeover
            self._takeover = min(2 * self._takeover, TAKEN_OVER_LONGEST)
        elif life >= HELD:
            self._current.delay = FIRST_DELAY
            self._current.due = self.due = now
        else:
            self._back_off(now)
            self._choose(now)

    def _back_off(self, now: float) -> None:
        node = self._current
        node.due = now + node.delay * self._shortened()
        node.delay = min(2 * node.delay, LONGEST_DELAY)

    def _shortened(self) -> float:
        return 1 - JITTER * self.chance()

    def _choose(self, now: float) -> None:
        """Take the next node in turn whose time has come, else the one whose time comes first."""
        in_turn = [(self.node + step) % self.nodes for step in range(1, self.nodes + 1)]
        self.node = min(in_turn, key=lambda each: max(now, self._all[each].due))
        self.due = max(now, self._all[self.node].due)
