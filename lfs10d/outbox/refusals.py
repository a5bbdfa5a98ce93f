"""Topics that the broker refuses: which are skipped now, and when each is tried again. Pure: time is an argument.

=====================================  ==============  ==================================  =======================
refusal                                the message     the topic                           tried again
=====================================  ==============  ==================================  =======================
PUBACK 0x80, 0x83, 0x91, 0x97          waits           is passed over for 1, 2, 4 .. 60 s  after that
PUBACK 0x90, 0x95, 0x99; too large     cut, or dead    goes on                             (the next message)
any other PUBACK from 0x80 on          waits           is passed over                      at the next connect
ended the connection, see `suspects`   cut, or dead    is passed over for an hour          after that
=====================================  ==============  ==================================  =======================

A reload tries everything again.
"""

from __future__ import annotations

from enum import StrEnum

UNFIT_REASONS = frozenset({0x90, 0x95, 0x99})
"""Topic name invalid, packet too large, payload format invalid (MQTT 5.0, section 2.4): the message itself is wrong."""

LATER_REASONS = frozenset({0x80, 0x83, 0x91, 0x97})
"""Unspecified error, implementation specific error, packet identifier in use, quota exceeded: it may pass."""

LATER_FIRST, LATER_LONGEST = 1.0, 60.0
"""Seconds for which a topic is passed over, doubled at each refusal in a row."""

BANNED_FOR = 3600.0
"""Seconds for which a topic is passed over whose messages end the connection."""

_NEXT_CONNECT = float("inf")


class Refusal(StrEnum):
    """What a reason code says of the message and its topic."""

    UNFIT = "unfit"
    """Wrong in itself: it is never sent again as it is."""
    LATER = "later"
    """Says nothing lasting: tried again with back-off."""
    DENIED = "denied"
    """Says that we may not: tried again at the next connect."""


def refusal_of(reason: int) -> Refusal:
    """Return what a reason code >= 0x80 of a PUBACK means; one that MQTT does not know is a denial."""
    if reason in UNFIT_REASONS:
        return Refusal.UNFIT
    return Refusal.LATER if reason in LATER_REASONS else Refusal.DENIED


class Refusals:
    """The rules above."""

    def __init__(self) -> None:
        self.topics: set[str] = set()
        """Topics under `B` to be passed over now."""
        self._until: dict[str, float] = {}
        self._delay: dict[str, float] = {}
        self._bans: dict[str, float] = {}
        self.reported: set[str] = set()
        """Topics of which a refusal was reported and that nothing was accepted on since."""
        self._unfit: set[str] = set()

    def refused(self, topic: str, reason: int, now: float) -> bool:
        """Pass over a topic whose message the broker refused, not as `UNFIT`; return True if it is to be reported."""
        if refusal_of(reason) is Refusal.LATER:
            delay = self._delay.get(topic, LATER_FIRST)
            self._until[topic] = max(now + delay, self._until.get(topic, now))
            self._delay[topic] = min(2 * delay, LATER_LONGEST)
        else:
            self._until[topic] = _NEXT_CONNECT
        self.topics.add(topic)
        if topic in self.reported:
            return False
        self.reported.add(topic)
        return True

    def unfit(self, topic: str) -> bool:
        """Note a message that is wrong in itself; return True if its topic is to be reported."""
        reported = topic in self._unfit
        self._unfit.add(topic)
        return not reported

    def ban(self, topic: str, now: float) -> None:
        """Pass over a topic whose messages end the connection, over connects too."""
        self._bans[topic] = now + BANNED_FOR
        self.topics.add(topic)

    def accepted(self, topic: str) -> None:
        """Note that the broker took a message of a topic."""
        self.reported.discard(topic)
        self._delay.pop(topic, None)

    def lift(self, now: float) -> frozenset[str]:
        """Return the topics whose time is over; they are passed over no longer."""
        self._until = {topic: until for topic, until in self._until.items() if until > now}
        self._bans = {topic: until for topic, until in self._bans.items() if until > now}
        lifted = frozenset(self.topics - self._until.keys() - self._bans.keys())
        self.topics -= lifted
        return lifted

    def connected(self, now: float) -> frozenset[str]:
        """Return the topics to be tried again on a new connection: all but those that end it."""
        self._until.clear()
        return self.lift(now)

    def reload(self, now: float) -> frozenset[str]:
        """Forget everything; return the topics that were passed over."""
        self._delay.clear()
        self._bans.clear()
        self.reported.clear()
        self._unfit.clear()
        return self.connected(now)

    def due(self) -> float | None:
        """Return when a topic is to be tried again by time alone; None: none is."""
        times = [until for until in (*self._until.values(), *self._bans.values()) if until < _NEXT_CONNECT]
        return min(times, default=None)
