"""Wind statistics straight from their definitions, in time that grows with the square: the reference for the tests.

It shares no code with the product. Times are whole milliseconds; a series is a list of (time, value, hold).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

Good: TypeAlias = tuple[int, float, int]
"""When it was measured, what, and for how long it holds at most."""

GUST = 3000


@dataclass(frozen=True)
class Naive:
    """Good values of one device in order of time."""

    values: Sequence[Good]

    def held(self, begin: int, end: int) -> list[tuple[float, int]]:
        """Return each value with the time it holds within [begin, end)."""
        found = []
        for place, (at, value, hold) in enumerate(self.values):
            until = at + hold
            if place + 1 < len(self.values):
                until = min(until, self.values[place + 1][0])
            time = min(until, end) - max(at, begin)
            if time > 0:
                found.append((value, time))
        return found

    def covered(self, begin: int, end: int) -> int:
        """Return the time for which there is a value."""
        return sum(time for _, time in self.held(begin, end))

    def mean(self, begin: int, end: int) -> float:
        """Return the mean, weighted by time; there is a value."""
        return sum(value * time for value, time in self.held(begin, end)) / self.covered(begin, end)

    def deviation(self, begin: int, end: int) -> float:
        """Return the population standard deviation, weighted by time."""
        mean, covered = self.mean(begin, end), self.covered(begin, end)
        return math.sqrt(sum((value - mean) ** 2 * time for value, time in self.held(begin, end)) / covered)

    def measured(self, begin: int, end: int) -> list[Good]:
        """Return what was measured within [begin, end)."""
        return [each for each in self.values if begin <= each[0] < end]

    def gust_at(self, place: int) -> float | None:
        """Return the mean of 3 s that ends with the value at `place`, None where there is none."""
        last = self.values[place][0]
        first = min(each for each in range(place + 1) if self.values[each][0] > last - GUST)
        window = self.values[first : place + 1]
        whole = all(before[0] + before[2] >= after[0] for before, after in pairwise(window))
        if len(window) < 3 or not whole:
            return None
        return sum(value for _, value, _ in window) / len(window)

    def gusts(self, begin: int, end: int) -> list[tuple[float, int]]:
        """Return the means of 3 s taken within [begin, end), each with its time."""
        places = (place for place, (at, _, _) in enumerate(self.values) if begin <= at < end)
        gusts = ((self.gust_at(place), self.values[place][0]) for place in places)
        return [(gust, at) for gust, at in gusts if gust is not None]

    def vector(self, begin: int, end: int) -> tuple[float, float]:
        """Return the mean of unit vectors of directions: north, east."""
        covered, held = self.covered(begin, end), self.held(begin, end)
        north = sum(math.cos(math.radians(value)) * time for value, time in held) / covered
        return north, sum(math.sin(math.radians(value)) * time for value, time in held) / covered


def yamartino(north: float, east: float) -> float:
    """Return Yamartino's standard deviation in degrees of directions whose mean vector this is."""
    epsilon = math.sqrt(max(0.0, 1 - (north**2 + east**2)))
    return math.degrees(math.asin(epsilon) * (1 + (2 / math.sqrt(3) - 1) * epsilon**3))


def sector(directions: Sequence[int]) -> int:
    """Return the width in degrees of the least sector that holds all of these whole directions."""
    seen = {direction % 360 for direction in directions}
    return min(max((direction - start) % 360 for direction in seen) for start in seen)
