"""Mean, standard deviation, gust and lull of a wind speed over any window of the last minutes. Pure.

A gust or lull is a mean of 3 s (WMO-No. 8, part I, 5.1.1; ICAO Annex 3, appendix 3, 4.1.3): the arithmetic mean of the
values in the half-open window (t - 3 s, t], taken at every value, where there are at least three and no gap between
them. Means are weighted by the time for which each value holds.
"""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections import deque
from dataclasses import dataclass, field
from itertools import accumulate
from math import inf, isnan, sqrt
from operator import mul
from typing import Final

from lfs10d.telemetry.wind.series import BLOCK, HeldSeries

GUST_OVER: Final = 3000
"""Milliseconds of a gust's mean (WMO-No. 8)."""

GUST_LEAST: Final = 3
"""Values that a gust's mean is made of at least."""


@dataclass(slots=True)
class Mean:
    """`covered` milliseconds with their mean and the sum of their squared deviations from it (in ms)."""

    covered: int = 0
    mean: float = 0.0
    squares: float = 0.0

    @property
    def deviation(self) -> float:
        """The population standard deviation."""
        return sqrt(self.squares / self.covered) if self.covered else 0.0

    def add(self, other: Mean) -> None:
        """Take the time of another window as well (Chan, Golub and LeVeque, 1979)."""
        covered = self.covered + other.covered
        if not other.covered:
            return
        apart = other.mean - self.mean
        self.squares += other.squares + apart * apart * self.covered * other.covered / covered
        self.mean += apart * other.covered / covered
        self.covered = covered


@dataclass(frozen=True, slots=True)
class Peak:
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


def _column() -> array[float]:
    return array("d")


@dataclass(slots=True)
class _Blocks:
    """What each block sums up to, one column per figure; without a gust -inf, without a lull inf."""

    covered: array[float] = field(default_factory=_column)
    first: array[float] = field(default_factory=_column)
    second: array[float] = field(default_factory=_column)
    samples: array[float] = field(default_factory=_column)
    greatest: array[float] = field(default_factory=_column)
    gust: array[float] = field(default_factory=_column)
    gust_at: array[float] = field(default_factory=_column)
    lull: array[float] = field(default_factory=_column)
    lull_at: array[float] = field(default_factory=_column)

    @property
    def columns(self) -> tuple[array[float], ...]:
        """All of them, in this order."""
        return (
            self.covered, self.first, self.second, self.samples, self.greatest,
            self.gust, self.gust_at, self.lull, self.lull_at,
        )  # fmt: skip


class SpeedSeries(HeldSeries):
    """The speeds of one anemometer."""

    __slots__ = ("_blocks", "_zero")

    def __init__(self) -> None:
        super().__init__()
        self._blocks = _Blocks()
        self._zero = 0.0
        """What speeds are counted from in sums of squares: near the mean these lose no digits."""

    def mean(self, begin: int, end: int) -> Mean:
        """Return the mean over [begin, end)."""
        parts = self._holding(begin, end)
        blocks = self._blocks
        covered, one, two = (sum(each[parts.blocks]) for each in (blocks.covered, blocks.first, blocks.second))
        for first, last in parts.raw:
            more = self._sums(first, last, begin, end)
            covered, one, two = covered + more[0], one + more[1], two + more[2]
        if not covered:
            return Mean()
        return Mean(round(covered), self._zero + one / covered, max(0.0, two - one * one / covered))

    def extremes(self, begin: int, end: int) -> Extremes:
        """Return what was measured, and the gusts that were taken, within [begin, end)."""
        parts = self._measured(begin, end)
        (head, *tail), found = parts.raw, Extremes()
        found.add(self._scan(*head))
        if tail:
            found.add(self._of_blocks(parts.blocks))
            found.add(self._scan(*tail[0]))
        return found

    def newest_gust(self) -> float | None:
        """Return the mean of 3 s that was taken at the newest value, None where it was none."""
        last = len(self._times)
        gust = self._scan(last - 1, last).gust if last else None
        return None if gust is None else gust.speed

    def _sums(self, first: int, last: int, begin: int, end: int) -> tuple[float, float, float]:
        """Return time covered, and the integrals of the speed and of its square, counted from `_zero`."""
        values, held = self._held(first, last, begin, end)
        zero = self._zero
        apart = [value - zero for value in values]
        weighted = list(map(mul, apart, held))
        one = sum(weighted)
        if isnan(one):  # a gap is not a number
            held = [0 if isnan(value) else time for value, time in zip(apart, held, strict=True)]
            apart = [0.0 if isnan(value) else value for value in apart]
            weighted = list(map(mul, apart, held))
            one = sum(weighted)
        return sum(held), one, sum(map(mul, weighted, apart))

    def _scan(self, first: int, last: int) -> Extremes:
        """Return the extremes of these entries; a gust may reach back to entries before them."""
        if first >= last:
            return Extremes()
        start = bisect_right(self._times, self._times[first] - GUST_OVER, 0, first)
        times, values = self._times[start:last].tolist(), self._values[start:last].tolist()
        sums = list(accumulate(values, initial=0.0))
        if isnan(sums[-1]):
            return self._scan_gaps(first - start, times, values)
        gusts, places, oldest = [], [], 0
        for place in range(first - start, last - start):
            until = times[place] - GUST_OVER
            while times[oldest] <= until:
                oldest += 1
            count = place + 1 - oldest
            if count >= GUST_LEAST:
                gusts.append((sums[place + 1] - sums[oldest]) / count)
                places.append(place)
        return self._found(last - first, max(values[first - start :]), gusts, [times[place] for place in places])

    def _scan_gaps(self, first: int, times: list[int], values: list[float]) -> Extremes:
        """Return the extremes of the entries from `first` on, where there are gaps among them or before them."""
        gusts, ends, good, window = [], [], [], deque[float]()
        since = deque[int]()
        whole_from = 0  # the window has no gap between its values if its oldest entry is none before this one
        for place, (at, value) in enumerate(zip(times, values, strict=True)):
            while since and times[since[0]] <= at - GUST_OVER:
                since.popleft()
                window.popleft()
            if isnan(value):
                whole_from = place
                continue
            since.append(place)
            window.append(value)
            if place < first:
                continue
            good.append(value)
            if len(window) >= GUST_LEAST and since[0] >= whole_from:
                gusts.append(sum(window) / len(window))
                ends.append(at)
        return self._found(len(good), max(good, default=-inf), gusts, ends)

    def _found(self, samples: int, greatest: float, gusts: list[float], ends: list[int]) -> Extremes:
        if not gusts:
            return self._extremes(samples, greatest, (-inf, 0), (inf, 0))
        gust, lull = max(gusts), min(gusts)
        last, origin = len(gusts) - 1, self._origin
        backwards = gusts[::-1]  # of equal ones the later counts
        return self._extremes(
            samples,
            greatest,
            (gust, ends[last - backwards.index(gust)] + origin),
            (lull, ends[last - backwards.index(lull)] + origin),
        )

    def _of_blocks(self, which: slice) -> Extremes:
        blocks = self._blocks
        gusts, lulls = blocks.gust[which], blocks.lull[which]
        gust, lull = max(gusts), min(lulls)
        gust_at = blocks.gust_at[which][len(gusts) - 1 - gusts[::-1].index(gust)]
        lull_at = blocks.lull_at[which][len(lulls) - 1 - lulls[::-1].index(lull)]
        return self._extremes(
            int(sum(blocks.samples[which])), max(blocks.greatest[which]), (gust, int(gust_at)), (lull, int(lull_at))
        )

    def _extremes(self, samples: int, greatest: float, gust: tuple[float, int], lull: tuple[float, int]) -> Extremes:
        return Extremes(
            samples,
            greatest if samples else None,
            None if gust[0] == -inf else Peak(*gust),
            None if lull[0] == inf else Peak(*lull),
        )

    def _closed(self) -> int:
        return len(self._blocks.covered)

    def _close(self, first: int) -> None:
        begin, end = (self._times[place] + self._origin for place in (first, first + BLOCK))
        found = self._scan(first, first + BLOCK)
        covered, one, two = self._sums(first, first + BLOCK, begin, end)
        gust, lull = found.gust or Peak(-inf, 0), found.lull or Peak(inf, 0)
        greatest = -inf if found.greatest is None else found.greatest
        figures = (covered, one, two, found.samples, greatest, gust.speed, gust.at, lull.speed, lull.at)
        for column, figure in zip(self._blocks.columns, figures, strict=True):
            column.append(figure)

    def _drop(self, blocks: int) -> None:
        for column in self._blocks.columns:
            del column[:blocks]

    def _start(self, value: float) -> None:
        self._zero = value
