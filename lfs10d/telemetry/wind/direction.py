"""Mean, standard deviation and range of a wind direction over any window of the last minutes. Pure.

Directions are degrees from north, clockwise. Their mean is that of unit vectors, weighted by the time for which each
holds; the standard deviation is Yamartino's (Journal of Climate and Applied Meteorology 23, 1984, p. 1362-1366).
"""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Sequence
from math import asin, atan2, cos, degrees, hypot, radians, sin, sqrt
from typing import ClassVar, Final

from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.wind.series import BLOCK, GAP, HeldSeries, Sums

RESULTANT_LEAST: Final = 0.05
"""Length of the mean vector below which it has no direction."""

VARIABLE_FROM: Final = 60
"""Degrees within 10 min from which a direction is variable (ICAO Annex 3, appendix 3, 4.1.5.2)."""

VARIABLE_BELOW: Final = 180
"""Degrees from which no extremes are reported (ICAO Annex 3, appendix 3, 4.1.5.2)."""

CIRCLE: Final = 360
SEEN_BYTES: Final = 46
"""A bit for each whole direction, 1 to 360."""


def compass(direction: float) -> int:
    """Return a direction as whole degrees from 1 to 360, which is north."""
    return round(direction) % CIRCLE or CIRCLE


@dataclass(slots=True)
class Vector:
    """`covered` milliseconds with the integrals of the unit vector's north and east parts (in ms)."""

    covered: int = 0
    north: float = 0.0
    east: float = 0.0

    def add(self, other: Vector) -> None:
        """Take the time of another window as well."""
        self.covered += other.covered
        self.north += other.north
        self.east += other.east

    @property
    def direction(self) -> int | None:
        """The mean, None where the vectors cancel out or nothing is covered."""
        if not self.covered or hypot(self.north, self.east) / self.covered < RESULTANT_LEAST:
            return None
        return compass(degrees(atan2(self.east, self.north)))

    @property
    def deviation(self) -> float | None:
        """The standard deviation in degrees, None where nothing is covered."""
        if not self.covered:
            return None
        length = hypot(self.north, self.east) / self.covered
        apart = sqrt(max(0.0, 1.0 - length * length))
        return degrees(asin(apart) * (1.0 + (2.0 / sqrt(3.0) - 1.0) * apart**3))


@dataclass(frozen=True, slots=True)
class Spread:
    """The least sector that holds all directions: clockwise from `begin` to `end`, `degrees` wide."""

    degrees: int
    begin: int
    end: int


def spread(seen: int) -> Spread | None:
    """Return the sector of the directions whose bits (1 to 360) are set in `seen`, None where there is none."""
    if not seen:
        return None
    bits = f"{seen >> 1:0{CIRCLE}b}"[::-1]  # one digit per degree, the first is that of 1
    first = bits.index("1")
    calms = list(map(len, (bits[first + 1 :] + bits[: first + 1]).split("1")[:-1]))  # after each direction, to the next
    widest = max(calms)
    place = calms.index(widest)
    end = first + place + sum(calms[:place])
    return Spread(CIRCLE - 1 - widest, compass(end + widest + 2), compass(end + 1))


class DirectionSeries(HeldSeries):
    """The directions of one vane. Of the sums of a block, the integrals are those of the unit vector: north, east."""

    __slots__ = ("_open_seen", "_samples", "_seen")

    reach: ClassVar[int] = 660_000
    """The last 10 min, and what a record may still want of the minute before."""

    def __init__(self) -> None:
        super().__init__()
        self._samples, self._seen = array("B"), bytearray()
        """Of each closed block; the directions seen in it as `SEEN_BYTES`."""
        self._open_seen = 0
        """The directions seen in the newest block."""

    def vector(self, begin: int, end: int) -> Vector:
        """Return the mean vector over [begin, end)."""
        return self.vector_of(self.between(self.edge(begin), self.edge(end)))

    def vector_of(self, sums: Sums) -> Vector:
        """Return the mean vector of a window with these sums."""
        return Vector(*sums)

    def samples(self, begin: int, end: int) -> int:
        """Return how many values were measured within [begin, end)."""
        first, last, blocks = self._measured(begin, end)
        if blocks.start >= blocks.stop:
            return last - first - self._values[first:last].count(GAP)
        ends = (*self._values[first : blocks.start * BLOCK], *self._values[blocks.stop * BLOCK : last])
        return sum(self._samples[blocks]) + len(ends) - ends.count(GAP)

    def spread(self, begin: int, end: int) -> Spread | None:
        """Return the sector of what was measured within [begin, end)."""
        first, last, blocks = self._measured(begin, end)
        if blocks.start >= blocks.stop:
            return spread(self._bits(first, last))
        newest = blocks.stop * BLOCK
        seen = self._open_seen if last == len(self._times) else self._bits(newest, last)
        seen |= self._seen_in(blocks.start, blocks.stop)
        if first < blocks.start * BLOCK and self._seen_in(blocks.start - 1, blocks.start) & ~seen:
            seen |= self._bits(first, blocks.start * BLOCK)
        return spread(seen)

    def _measured(self, begin: int, end: int) -> tuple[int, int, slice]:
        """Return the first entry that begins within [begin, end), the one behind the last, and the blocks between."""
        first = bisect_left(self._times, begin - self._origin)
        last = max(first, bisect_left(self._times, end - self._origin))
        return first, last, slice(-(-first // BLOCK), min(last // BLOCK, self._closed))

    def _seen_in(self, first: int, last: int) -> int:
        """Return the directions seen in these blocks: they lie one behind the other, and are laid over one another."""
        seen, blocks = int.from_bytes(self._seen[first * SEEN_BYTES : last * SEEN_BYTES], "little"), last - first
        while blocks > 1:
            blocks = (blocks + 1) // 2
            width = blocks * SEEN_BYTES * 8
            seen = seen >> width | seen & ((1 << width) - 1)
        return seen

    def _bits(self, first: int, last: int) -> int:
        seen, scale = 0, self._scale
        for value in self._values[first:last]:
            if value != GAP:
                seen |= 1 << compass(value / scale)
        return seen

    def _sums(self, values: Sequence[float], held: list[int]) -> Sums:
        """Return the time covered, and the integrals of the unit vector's north and east parts."""
        scale = self._scale
        pairs = [(radians(value / scale), time) for value, time in zip(values, held, strict=True) if value != GAP]
        north, east = sum(cos(angle) * time for angle, time in pairs), sum(sin(angle) * time for angle, time in pairs)
        return Sums(sum(time for _, time in pairs), north, east)

    def _newest(self, held: int) -> Sums:
        angle = radians(self._newest_kept / self._scale)
        return Sums(held, cos(angle) * held, sin(angle) * held)

    def _took(self, at: int, kept: float) -> None:  # noqa: ARG002 - a direction's time is of no further use
        self._open_seen |= 1 << (round(kept / self._scale) % CIRCLE or CIRCLE)

    def _close(self) -> None:
        self._samples.append(BLOCK - self._open_gaps)
        self._seen += self._open_seen.to_bytes(SEEN_BYTES, "little")

    def _empty_open(self) -> None:
        super()._empty_open()
        self._open_seen = 0

    def _drop(self, blocks: int) -> None:
        super()._drop(blocks)
        del self._samples[:blocks], self._seen[: blocks * SEEN_BYTES]
