"""The greatest and least of what was measured in a window: values, and means of 3 s. Pure."""

from __future__ import annotations

from math import inf
from typing import Final, NamedTuple

from lfs10d.system.dataclass import dataclass


class Peak(NamedTuple):
    """A gust or lull, and when its mean ended (ms)."""

    speed: float
    at: int


@dataclass(slots=True)
class Extremes:
    """`samples` values, the greatest of them, the greatest and the least mean of 3 s; None where there is none."""

    samples: int = 0
    greatest: float | None = None
    gust: Peak | None = None
    lull: Peak | None = None

    def add(self, other: Extremes) -> None:
        """Take the values of a later window as well; of equal ones the later counts."""
        self.samples += other.samples
        if other.greatest is not None and (self.greatest is None or other.greatest > self.greatest):
            self.greatest = other.greatest
        if other.gust is not None and (self.gust is None or other.gust.speed >= self.gust.speed):
            self.gust = other.gust
        if other.lull is not None and (self.lull is None or other.lull.speed <= self.lull.speed):
            self.lull = other.lull


class Found(NamedTuple):
    """`samples` values and the greatest of them; the greatest and least mean of 3 s, and the entries they end with.

    Without one they are -inf and inf.
    """

    samples: int
    greatest: float
    gust: float
    gust_place: int
    lull: float
    lull_place: int

    def with_later(self, other: Found) -> Found:
        """Return what is found in both; of equal gusts the later counts."""
        gust = other if other.gust >= self.gust else self
        lull = other if other.lull <= self.lull else self
        return Found(
            self.samples + other.samples,
            max(self.greatest, other.greatest),
            gust.gust,
            gust.gust_place,
            lull.lull,
            lull.lull_place,
        )


NOTHING_FOUND: Final = Found(0, -inf, -inf, 0, inf, 0)
