"""The time of wind statistics: whole milliseconds that fit the `ts` of samples and never jump. Pure.

Figures are to be those that anybody computes from the samples as published, whose `ts` are whole milliseconds of the
wall clock. So times are these `ts` less the distance of the wall clock from the monotonic one, which is kept as it is
until it changes by more than clocks differ from one look to the next: when the wall clock is set.
"""

from __future__ import annotations

from typing import Final

from lfs10d.system.clock import Instant
from lfs10d.system.clock_step import ClockState
from lfs10d.system.dataclass import dataclass

EVEN_WITHIN: Final = 20
"""Milliseconds by which the distance of the clocks may change before it is taken anew."""


@dataclass(frozen=True, slots=True)
class WindMoment:
    """A moment: `at` in ms of these statistics, `ts` in epoch ms; `shift` is their difference."""

    at: int
    ts: int
    clock: ClockState

    @property
    def shift(self) -> int:
        """The wall clock less `at`."""
        return self.ts - self.at


class WindClock:
    """Begins at `now`."""

    def __init__(self, now: Instant) -> None:
        self._shift = round((now.wall - now.mono) * 1000)

    def at(self, reading_at: float, now: Instant) -> int:
        """Return the time of a reading, whose time by the monotonic clock is `reading_at`, as seen at `now`."""
        ahead = now.wall - now.mono
        if not -EVEN_WITHIN <= ahead * 1000 - self._shift <= EVEN_WITHIN:
            self._shift = round(ahead * 1000)
        return round((ahead + reading_at) * 1000) - self._shift

    def moment(self, now: Instant) -> WindMoment:
        """Return the moment `now`."""
        ts = now.ts()
        return WindMoment(self.at(now.mono, now), ts, now.clock)
