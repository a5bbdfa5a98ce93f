"""Readings held back for a moment: another answer may still show that theirs is a second one. Pure. Times in s.

A second answer that comes when the next answer is due looks like that answer. The slave's own then follows it. So a
reading whose own answer could still come is published only when that time is over, or when its slave was read again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import inf

from lfs10d.reading import Fault, Reading


class HeldReadings:
    """The readings of one line that are held back, in order; None of them is waited for by the line."""

    def __init__(self) -> None:
        self._held: deque[tuple[float, Reading]] = deque()

    @property
    def next_at(self) -> float:
        """When the first of them is over, inf where there is none."""
        return min((until for until, _ in self._held), default=inf)

    def hold(self, readings: Iterable[Reading], until: float) -> None:
        """Hold these back until then."""
        self._held.extend((until, reading) for reading in readings)

    def holds(self, device: str, at: float) -> bool:
        """Whether a reading of a device was held back at `at`."""
        return any(reading.device == device and reading.at < at <= until for until, reading in self._held)

    def spoil(self, device: str, at: float, fault: Fault) -> None:
        """Let the readings of a device fail that were held back at `at`: what was heard then may be its own answer."""
        for place, (until, reading) in enumerate(self._held):
            if reading.device == device and reading.at < at <= until:
                failed = replace(reading, values=None, rtt=None, fault=fault)
                self._held[place] = -inf, failed

    def released(self, now: float = inf, device: str | None = None) -> Iterator[Reading]:
        """Yield, and take, those whose time is over by `now` (inf: all), those of one device only if it is given."""
        for until, reading in tuple(self._held):
            if until <= now and device in (None, reading.device):
                self._held.remove((until, reading))
                yield reading
