"""Mean, standard deviation and range of a wind direction over any window of the last minutes. Pure.

Directions are degrees from north, clockwise. Their mean is that of unit vectors, weighted by the time for which each
holds; the standard deviation is Yamartino's (Journal of Climate and Applied Meteorology 23, 1984, p. 1362-1366).
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from math import asin, atan2, cos, degrees, hypot, radians, sin, sqrt
from typing import ClassVar, Final

from lfs10d.telemetry.wind.series import BLOCK, GAP, Edge, HeldSeries, Sums

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
    calms = (bits[first + 1 :] + bits[: first + 1]).split("1")[:-1]  # after each direction, to the next
    widest = max(calms, key=len)
    place, begin = first, first
    for calm in calms:
        following = (place + 1 + len(calm)) % CIRCLE
        if calm is widest:
            begin = following
            break
        place = following
    return Spread(CIRCLE - 1 - len(widest), begin + 1, place + 1)


class DirectionSeries(HeldSeries):
    """The directions of one vane. Of the sums of a block, the integrals are those of the unit vector: north, east."""

    __slots__ = ("_samples", "_seen")

    reach: ClassVar[int] = 660_000
    """The last 10 min, and what a record may still want of the minute before."""

    def __init__(self) -> None:
        super().__init__()
        self._samples, self._seen = array("B"), bytearray()
        """Of each block; the directions seen in it as `SEEN_BYTES`."""

    def vector(self, begin: int, end: int) -> Vector:
        """Return the mean vector over [begin, end)."""
        return self.vector_between(self.begin(begin), self.until(end))

    def vector_between(self, begin: Edge, end: Edge) -> Vector:
        """Return the mean vector from one moment to a later one."""
        covered, north, east = self.between(begin, end)
        return Vector(round(covered), north, east)

    def samples(self, begin: int, end: int) -> int:
        """Return how many values were measured within [begin, end)."""
        parts = self._measured(begin, end)
        return sum(self._samples[parts.blocks]) + sum(len(self._good(*each)) for each in parts.raw)

    def spread(self, begin: int, end: int) -> Spread | None:
        """Return the sector of what was measured within [begin, end)."""
        parts = self._measured(begin, end)
        seen = 0
        for block in range(parts.blocks.start, parts.blocks.stop):
            seen |= int.from_bytes(self._seen[block * SEEN_BYTES : (block + 1) * SEEN_BYTES], "little")
        for first, last in parts.raw:
            seen |= self._bits(first, last)
        return spread(seen)

    def _good(self, first: int, last: int) -> list[float]:
        scale = self._scale
        return [value / scale for value in self._values[first:last] if value != GAP]

    def _bits(self, first: int, last: int) -> int:
        seen = 0
        for value in self._good(first, last):
            seen |= 1 << compass(value)
        return seen

    def _sums(self, values: Sequence[float], held: list[int]) -> Sums:
        """Return the time covered, and the integrals of the unit vector's north and east parts."""
        scale = self._scale
        pairs = [(radians(value / scale), time) for value, time in zip(values, held, strict=True) if value != GAP]
        north, east = sum(cos(angle) * time for angle, time in pairs), sum(sin(angle) * time for angle, time in pairs)
        return Sums(sum(time for _, time in pairs), north, east)

    def _close(self, first: int) -> None:
        self._samples.append(len(self._good(first, first + BLOCK)))
        self._seen += self._bits(first, first + BLOCK).to_bytes(SEEN_BYTES, "little")

    def _drop(self, blocks: int) -> None:
        super()._drop(blocks)
        del self._samples[:blocks], self._seen[: blocks * SEEN_BYTES]

    def _start(self, kept: float) -> None:
        """Nothing depends on it."""

    def _scaled_down(self) -> None:
        """Nothing is in parts of a degree."""
