"""Holds readings back for a moment, until it is sure that their answer belongs to their request. Pure. Times in s.

A second answer that comes when the next answer is due looks like that answer. The slave's own then follows it. So a
reading whose own answer could still come is published only when its slave was read again, or after a time within which
that answer comes even where bytes lie unread for a while, as on a busy machine.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import inf

from lfs10d.reading import Fault, Reading


class HeldReadings:
    """The readings of one line that are held back, in order; None of them is waited for by the line.

    `entries` has with each reading until when it is held, and when its slave's own answer would have come.
    """

    def __init__(self) -> None:
        self.entries: deque[tuple[float, float, Reading]] = deque()

    @property
    def next_at(self) -> float:
        """When the first of them is over, inf where there is none."""
        return min((until for until, _, _ in self.entries), default=inf)

    def hold(self, readings: Iterable[Reading], until: float, own_by: float) -> None:
        """Hold these back until then; their slave's own answer would have come by `own_by`."""
        self.entries.extend((until, own_by, reading) for reading in readings)

    def extend(self, device: str, until: float, own_by: float) -> None:
        """Hold the readings of a device that are held back for longer: until then, or until proved."""
        for place, (over, _, reading) in enumerate(self.entries):
            if reading.device == device and over > -inf:
                self.entries[place] = max(over, until), own_by, reading

    def holds(self, device: str, at: float) -> bool:
        """Whether the own answer to a held reading of a device may have come at `at` or later."""
        return any(reading.device == device and at <= own_by for _, own_by, reading in self.entries)

    def spoil(self, device: str, fault: Fault, *, at: float | None = None) -> None:
        """Let the readings of a device fail that are held back, or only those that were so at `at`."""
        for place, (until, _, reading) in enumerate(self.entries):
            if reading.device == device and (at is None or reading.at < at <= until):
                failed = reading if reading.values is None else replace(reading, values=None, rtt=None, fault=fault)
                self.entries[place] = -inf, -inf, failed

    def released(self, now: float = inf, device: str | None = None) -> Iterator[Reading]:
        """Yield, and take, those whose time is over by `now` (inf: all), those of one device only if it is given."""
        for held in tuple(self.entries):
            until, _, reading = held
            if until <= now and device in (None, reading.device):
                self.entries.remove(held)
                yield reading
