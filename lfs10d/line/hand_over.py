"""Collects events of the line thread for a moment, to hand several to the asyncio loop at once. Pure.

Each hand-over wakes the loop and makes a packet of its own, which costs more of the processor than the sample in it.
`hold` is how long a sample may wait for others (`mqtt.hold`), in s. What somebody waits for, and what is bad, goes at
once; so does a sample that no other can join in that time: at 9600 baud an exchange alone takes longer than 20 ms.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import inf
from typing import Final

from lfs10d.reading import Event, Exchanged, Purpose, Reading, UartCounted

REMEMBERED: Final = 8
"""Exchanges whose times tell how soon the next sample can be there."""


class HandOver:
    """Asked once for each turn that leaves events. Times are monotonic s."""

    def __init__(self) -> None:
        self.hold = 0.0
        self.at_once_until = -inf
        """Until then nothing is held: somebody watches the frames (`line/trace`)."""
        self._took: deque[float] = deque(maxlen=REMEMBERED)
        self._since = inf
        """When the first of the events that wait was left."""
        self._seen = 0
        """The number of events that were checked and can wait."""

    def on_exchange(self, took: float) -> None:
        """Note how long an exchange took with the silence before it, in s."""
        self._took.append(took)

    def due(self, events: Sequence[Event], now: float, asked: float) -> float:
        """Return when `events` must be handed over: at once where that is not after `now`.

        They grow from call to call until they are `handed_over`. `asked` is when the next exchange began, or will at
        the earliest.
        """
        if self.hold == 0 or now < self.at_once_until:
            return now
        if not self._seen:
            self._since = now
        latest = self._since + self.hold
        if asked + min(self._took, default=inf) > latest or not all(map(_can_wait, events[self._seen :])):
            return now
        self._seen = len(events)
        return latest

    def handed_over(self) -> None:
        """Note that nothing waits any more."""
        self._seen = 0


def _can_wait(event: Event) -> bool:
    """Return whether an event may wait: no request waits for it, it reports no fault, and many like it come."""
    match event:
        case Reading():
            return event.fault is None and not event.requests and not event.probe
        case Exchanged():
            return event.fault is None and event.purpose is Purpose.POLL
        case UartCounted():
            return True
        case _:
            return False
