"""Mean, standard deviation, gust and lull of a wind speed over any window of the last minutes. Pure.

A gust or lull is a mean of 3 s (WMO-No. 8, part I, 5.1.1; ICAO Annex 3, appendix 3, 4.1.3): the arithmetic mean of the
values in the half-open window (t - 3 s, t], taken at every value, where there are at least three and no gap between
them. Means are weighted by the time for which each value holds.
"""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import inf, sqrt
from operator import mul
from typing import Final, NamedTuple

from lfs10d.telemetry.wind.series import BLOCK, GAP, SCALE, Edge, HeldSeries, Sums

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


class _Found(NamedTuple):
    """`samples` values and the greatest of them; the greatest and least mean of 3 s, and the entries they end with.

    Without one they are -inf and inf.
    """

    samples: int
    greatest: float
    gust: float
    gust_place: int
    lull: float
    lull_place: int

    def with_later(self, other: _Found) -> _Found:
        """Return what is found in both; of equal gusts the later counts."""
        gust = other if other.gust >= self.gust else self
        lull = other if other.lull <= self.lull else self
        return _Found(
            self.samples + other.samples,
            max(self.greatest, other.greatest),
            gust.gust,
            gust.gust_place,
            lull.lull,
            lull.lull_place,
        )


_NONE: Final = _Found(0, -inf, -inf, 0, inf, 0)


class SpeedSeries(HeldSeries):
    """The speeds of one anemometer."""

    __slots__ = ("_greatest", "_gusts", "_gusts_at", "_lulls", "_lulls_at", "_samples", "_zero")

    def __init__(self) -> None:
        super().__init__()
        self._zero: float = 0
        """What speeds are counted from in sums of squares: near the mean these lose no digits."""
        self._samples, self._greatest = array("B"), array("d")
        self._gusts, self._gusts_at = array("d"), array("B")
        self._lulls, self._lulls_at = array("d"), array("B")
        """Of each block; gusts and lulls with their place in it, -inf and inf where there is none."""

    def mean(self, begin: int, end: int) -> Mean:
        """Return the mean over [begin, end)."""
        return self.mean_between(self.begin(begin), self.until(end))

    def mean_between(self, begin: Edge, end: Edge) -> Mean:
        """Return the mean from one moment to a later one."""
        covered, one, two = self.between(begin, end)
        if not covered:
            return Mean()
        scale = self._scale
        mean = (self._zero + one / covered) / scale
        return Mean(round(covered), mean, max(0.0, two - one * one / covered) / (scale * scale))

    def extremes(self, begin: int, end: int) -> Extremes:
        """Return what was measured, and the gusts that were taken, within [begin, end)."""
        parts = self._measured(begin, end)
        found = self._scan(*parts.raw[0])
        if len(parts.raw) > 1:
            found = found.with_later(self._of_blocks(parts.blocks)).with_later(self._scan(*parts.raw[1]))
        return Extremes(
            found.samples,
            found.greatest if found.samples else None,
            None if found.gust == -inf else Peak(found.gust, self._times[found.gust_place] + self._origin),
            None if found.lull == inf else Peak(found.lull, self._times[found.lull_place] + self._origin),
        )

    def newest_gust(self) -> float | None:
        """Return the mean of 3 s that was taken at the newest value, None where it was none."""
        last = len(self._times)
        gust = self._scan(last - 1, last).gust
        return None if gust == -inf else gust

    def _sums(self, values: Sequence[float], held: list[int]) -> Sums:
        """Return time covered, and the integrals of the speed as it is kept and of its square, counted from `_zero`."""
        if GAP in values:
            held = [0 if value == GAP else time for value, time in zip(values, held, strict=True)]
        zero = self._zero
        apart = [value - zero for value in values]
        weighted = list(map(mul, apart, held))
        return Sums(sum(held), sum(weighted), sum(map(mul, weighted, apart)))

    def _scan(self, first: int, last: int) -> _Found:
        """Return the extremes of these entries; a gust may reach back to entries before them."""
        if first >= last or first < 0:
            return _NONE
        start = bisect_right(self._times, self._times[first] - GUST_OVER, 0, first)
        times, values = self._times[start:last].tolist(), self._values[start:last].tolist()
        if GAP in values:
            return self._scan_gaps(start, first, times, values)
        sums = list(accumulate(values, initial=0))
        gusts, places, oldest = [], [], 0
        for place in range(first - start, last - start):
            until = times[place] - GUST_OVER
            while times[oldest] <= until:
                oldest += 1
            count = place + 1 - oldest
            if count >= GUST_LEAST:
                gusts.append((sums[place + 1] - sums[oldest]) / count)
                places.append(start + place)
        return self._found(last - first, max(values[first - start :]), gusts, places)

    def _scan_gaps(self, start: int, first: int, times: list[int], values: Sequence[float]) -> _Found:
        """Return the extremes of the entries from `first` on, where there are gaps among them or before them.

        Times and values are those from the entry `start` on.
        """
        gusts, places, good, window = [], [], [], deque[int]()
        whole_from = 0  # the window has no gap between its values if its oldest entry is none before this one
        for place, (at, value) in enumerate(zip(times, values, strict=True)):
            while window and times[window[0]] <= at - GUST_OVER:
                window.popleft()
            if value == GAP:
                whole_from = place
                continue
            window.append(place)
            if start + place < first:
                continue
            good.append(value)
            if len(window) >= GUST_LEAST and window[0] >= whole_from:
                gusts.append(sum(values[window[0] : place + 1]) / len(window))
                places.append(start + place)
        return self._found(len(good), max(good, default=-inf), gusts, places)

    def _found(self, samples: int, greatest: float, gusts: list[float], places: list[int]) -> _Found:
        scale = self._scale
        if not gusts:
            return _Found(samples, greatest / scale, -inf, 0, inf, 0)
        gust, lull, last = max(gusts), min(gusts), len(gusts) - 1
        backwards = gusts[::-1]  # of equal ones the later counts
        gust_at, lull_at = places[last - backwards.index(gust)], places[last - backwards.index(lull)]
        return _Found(samples, greatest / scale, gust / scale, gust_at, lull / scale, lull_at)

    def _of_blocks(self, which: slice) -> _Found:
        gusts, lulls, last = self._gusts[which], self._lulls[which], which.stop - 1
        gust, lull = max(gusts), min(lulls)
        gust_block, lull_block = last - gusts[::-1].index(gust), last - lulls[::-1].index(lull)
        return _Found(
            sum(self._samples[which]),
            max(self._greatest[which]),
            gust,
            gust_block * BLOCK + self._gusts_at[gust_block],
            lull,
            lull_block * BLOCK + self._lulls_at[lull_block],
        )

    def _close(self, first: int) -> None:
        found = self._scan(first, first + BLOCK)
        self._samples.append(found.samples)
        self._greatest.append(found.greatest)
        self._gusts.append(found.gust)
        self._gusts_at.append(max(0, found.gust_place - first))
        self._lulls.append(found.lull)
        self._lulls_at.append(max(0, found.lull_place - first))

    def _drop(self, blocks: int) -> None:
        super()._drop(blocks)
        for column in (self._samples, self._greatest, self._gusts, self._gusts_at, self._lulls, self._lulls_at):
            del column[:blocks]

    def _start(self, kept: float) -> None:
        self._zero = kept

    def _scaled_down(self) -> None:
        self._zero /= SCALE
        self._first = array("d", [each / SCALE for each in self._first])
        self._second = array("d", [each / SCALE**2 for each in self._second])
