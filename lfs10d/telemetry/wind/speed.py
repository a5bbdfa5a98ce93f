"""Mean, standard deviation, gust and lull of a wind speed over any window of the last minutes. Pure.

A gust or lull is a mean of 3 s (WMO-No. 8, part I, 5.1.1; ICAO Annex 3, appendix 3, 4.1.3): the arithmetic mean of the
values in the half-open window (t - 3 s, t], taken at every value, where there are at least three and no gap between
them. Means are weighted by the time for which each value holds.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from math import inf, sqrt
from operator import mul
from typing import Final

from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.wind.extremes import NOTHING_FOUND, Extremes, Found, Peak
from lfs10d.telemetry.wind.series import BLOCK, GAP, SCALE, HeldSeries, Sums

GUST_OVER: Final = 3000
"""Milliseconds of a gust's mean (WMO-No. 8)."""

GUST_LEAST: Final = 3
"""Values that a gust's mean is made of at least."""

_NOTHING: Final[tuple[float, float, float]] = (-inf, -inf, inf)
"""Greatest value, gust and lull of a block that has none yet."""


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


class SpeedSeries(HeldSeries):
    """The speeds of one anemometer."""

    __slots__ = (
        "_greatest",
        "_gust",
        "_gusts",
        "_gusts_at",
        "_lulls",
        "_lulls_at",
        "_oldest",
        "_open_greatest",
        "_open_gust",
        "_open_gust_place",
        "_open_lull",
        "_open_lull_place",
        "_samples",
        "_total",
        "_whole_from",
        "_zero",
    )

    _open_greatest: float
    _open_gust: float
    _open_lull: float

    def __init__(self) -> None:
        super().__init__()
        self._zero: float = 0
        """What speeds are counted from in sums of squares: near the mean these lose no digits."""
        self._samples, self._greatest = array("B"), array("d")
        self._gusts, self._gusts_at = array("d"), array("B")
        self._lulls, self._lulls_at = array("d"), array("B")
        """Of each closed block; gusts and lulls with their place in it, -inf and inf where there is none."""
        self._oldest = 0
        """The oldest value of the last 3 s that no gap parts from the newest."""
        self._total: float = 0
        """The sum of the values from there on, as they are kept."""
        self._whole_from = 0
        """When the values before the newest gap are 3 s old: until then there is no gust."""
        self._gust = -inf
        """The mean of 3 s at the newest value, as it is kept; -inf where there is none."""

    def mean(self, begin: int, end: int) -> Mean:
        """Return the mean over [begin, end)."""
        return self.mean_of(self.between(self.edge(begin), self.edge(end)))

    def mean_of(self, sums: Sums) -> Mean:
        """Return the mean of a window with these sums."""
        covered, one, two = sums
        if not covered:
            return Mean()
        scale = self._scale
        mean = (self._zero + one / covered) / scale
        return Mean(covered, mean, max(0.0, two - one * one / covered) / (scale * scale))

    def extremes(self, begin: int, end: int) -> Extremes:
        """Return what was measured, and the gusts that were taken, within [begin, end)."""
        first = bisect_left(self._times, begin - self._origin)
        last = max(first, bisect_left(self._times, end - self._origin))
        block, blocks = -(-first // BLOCK), min(last // BLOCK, self._closed)
        if block > blocks or last == block * BLOCK:
            found = self._scan(first, last)
        else:
            whole = last == len(self._times)
            found = self._found_open() if whole else self._scan(blocks * BLOCK, last)
            if block < blocks:
                found = self._of_blocks(slice(block, blocks)).with_later(found)
            if first < block * BLOCK:
                found = self._rest(block - 1, first, found).with_later(found)
        return Extremes(
            found.samples,
            found.greatest if found.samples else None,
            None if found.gust == -inf else Peak(found.gust, self._times[found.gust_place] + self._origin),
            None if found.lull == inf else Peak(found.lull, self._times[found.lull_place] + self._origin),
        )

    def newest_gust(self) -> float | None:
        """Return the mean of 3 s that was taken at the newest value, None where it was none."""
        return None if self._gust == -inf else self._gust / self._scale

    def _sums(self, values: Sequence[float], held: list[int]) -> Sums:
        """Return time covered, and the integrals of the speed as it is kept and of its square, counted from `_zero`."""
        if GAP in values:
            held = [0 if value == GAP else time for value, time in zip(values, held, strict=True)]
        zero = self._zero
        apart = [value - zero for value in values]
        weighted = list(map(mul, apart, held))
        return Sums(sum(held), sum(weighted), sum(map(mul, weighted, apart)))

    def _newest(self, held: int) -> Sums:
        apart = self._newest_kept - self._zero
        weighted = apart * held
        return Sums(held, weighted, weighted * apart)

    def _took(self, at: int, kept: float) -> None:
        times, oldest, outside = self._times, self._oldest, at - self._origin - GUST_OVER
        if self._scale == 1:  # a sum that runs on loses digits
            while times[oldest] <= outside:
                oldest += 1
            total = sum(self._values[oldest:])
        else:
            total = self._total + kept
            while times[oldest] <= outside:
                total -= self._values[oldest]
                oldest += 1
        self._oldest, self._total = oldest, total
        if kept > self._open_greatest:  # noqa: PLR1730 - a call would take longer; this is done for each sample
            self._open_greatest = kept
        count = len(times) - oldest
        if count < GUST_LEAST or at < self._whole_from:
            self._gust = -inf
            return
        self._gust = gust = total / count
        if gust >= self._open_gust:  # of equal ones the later counts
            self._open_gust, self._open_gust_place = gust, len(times) - 1
        if gust <= self._open_lull:
            self._open_lull, self._open_lull_place = gust, len(times) - 1

    def _gap(self) -> None:
        self._oldest, self._total = len(self._times), 0
        self._whole_from = self.newest + GUST_OVER

    # Extremes

    def _found_open(self) -> Found:
        """Return the extremes of the newest block."""
        scale = self._scale
        return Found(
            len(self._times) - self._closed * BLOCK - self._open_gaps,
            self._open_greatest / scale,
            self._open_gust / scale,
            self._open_gust_place,
            self._open_lull / scale,
            self._open_lull_place,
        )

    def _rest(self, block: int, first: int, later: Found) -> Found:
        """Return the extremes of the entries of a closed block from `first` on.

        They are looked for only if any of the block is beyond those of `later`.
        """
        end = (block + 1) * BLOCK
        if self._greatest[block] > later.greatest or self._gusts[block] > later.gust or self._lulls[block] < later.lull:
            return self._scan(first, end)
        whole = self._samples[block] == BLOCK
        return NOTHING_FOUND._replace(samples=end - first - (0 if whole else self._values[first:end].count(GAP)))

    def _of_blocks(self, which: slice) -> Found:
        gusts, lulls, last = self._gusts[which], self._lulls[which], which.stop - 1
        gust, lull = max(gusts), min(lulls)
        gust_block, lull_block = last - gusts[::-1].index(gust), last - lulls[::-1].index(lull)
        return Found(
            sum(self._samples[which]),
            max(self._greatest[which]),
            gust,
            gust_block * BLOCK + self._gusts_at[gust_block],
            lull,
            lull_block * BLOCK + self._lulls_at[lull_block],
        )

    def _scan(self, first: int, last: int) -> Found:
        """Return the extremes of these entries; a gust may reach back to entries before them."""
        if first >= last:
            return NOTHING_FOUND
        start = bisect_right(self._times, self._times[first] - GUST_OVER, 0, first)
        times, values = self._times[start:last].tolist(), self._values[start:last].tolist()
        gusts, places, good, oldest, whole_from = [], [], [], 0, 0
        for place, (at, value) in enumerate(zip(times, values, strict=True)):
            if value == GAP:
                oldest = place + 1
                whole_from = times[place - 1] + GUST_OVER if place else 0
                continue
            while times[oldest] <= at - GUST_OVER:
                oldest += 1
            if start + place < first:
                continue
            good.append(value)
            if place + 1 - oldest >= GUST_LEAST and at >= whole_from:
                gusts.append(sum(values[oldest : place + 1]) / (place + 1 - oldest))
                places.append(start + place)
        scale, greatest = self._scale, max(good, default=-inf)
        if not gusts:
            return NOTHING_FOUND._replace(samples=len(good), greatest=greatest / scale)
        gust, lull, end = max(gusts), min(gusts), len(gusts) - 1
        backwards = gusts[::-1]  # of equal ones the later counts
        gust_at, lull_at = places[end - backwards.index(gust)], places[end - backwards.index(lull)]
        return Found(len(good), greatest / scale, gust / scale, gust_at, lull / scale, lull_at)

    # Blocks

    def _close(self) -> None:
        found, first = self._found_open(), self._closed * BLOCK - BLOCK
        self._samples.append(BLOCK - self._open_gaps)
        self._greatest.append(found.greatest)
        self._gusts.append(found.gust)
        self._gusts_at.append(max(0, found.gust_place - first))
        self._lulls.append(found.lull)
        self._lulls_at.append(max(0, found.lull_place - first))

    def _empty_open(self) -> None:
        super()._empty_open()
        self._open_greatest, self._open_gust, self._open_lull = _NOTHING
        self._open_gust_place = self._open_lull_place = 0

    def _drop(self, blocks: int) -> None:
        super()._drop(blocks)
        self._oldest -= blocks * BLOCK
        for column in (self._samples, self._greatest, self._gusts, self._gusts_at, self._lulls, self._lulls_at):
            del column[:blocks]

    def _start(self, kept: float) -> None:
        self._zero = kept
        self._oldest, self._total, self._whole_from = 0, 0, 0

    def _scaled_down(self) -> None:
        self._zero /= SCALE
        covered, first, second = self._open_sums
        self._open_sums = Sums(covered, first / SCALE, second / SCALE**2)
        self._open_greatest /= SCALE
        self._open_gust /= SCALE
        self._open_lull /= SCALE
        self._first = array("d", [each / SCALE for each in self._first])
        self._second = array("d", [each / SCALE**2 for each in self._second])
