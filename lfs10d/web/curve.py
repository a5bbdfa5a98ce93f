"""The last hour of one value as steps of four seconds, each with its extremes and its failed polls. Pure.

Times are epoch seconds. A step takes 24 bytes, whatever the rate of polling.
"""

from __future__ import annotations

from array import array
from typing import Final, TypeAlias

STEP: Final = 4
"""s"""
KEPT: Final = 900
"""Steps: one hour."""

Point: TypeAlias = list[float | int | None]
"""Start of the step, mean, least, greatest (None: no good sample), failed polls."""


class Curve:
    """The steps in a ring; what is older than an hour before the newest is ignored."""

    __slots__ = ("_bad", "_greatest", "_least", "_number", "_place", "_sum", "newest")

    def __init__(self) -> None:
        self.newest = -1
        """The newest step; -1: none yet."""
        self._place = array("q", [-1]) * KEPT
        self._least = array("f", [0.0]) * KEPT
        self._greatest = array("f", [0.0]) * KEPT
        self._sum = array("f", [0.0]) * KEPT
        self._number = array("H", [0]) * KEPT
        self._bad = array("H", [0]) * KEPT

    def add(self, at: float, value: float | None) -> None:
        """Add a sample; None: a failed poll."""
        step = int(at // STEP)
        slot = step % KEPT
        if step <= self.newest - KEPT or self._number[slot] + self._bad[slot] >= 2**16 - 1:
            return
        if self._place[slot] != step:
            self._place[slot], self._sum[slot], self._number[slot], self._bad[slot] = step, 0.0, 0, 0
        self.newest = max(self.newest, step)
        if value is None:
            self._bad[slot] += 1
            return
        first = self._number[slot] == 0
        self._least[slot] = value if first else min(value, self._least[slot])
        self._greatest[slot] = value if first else max(value, self._greatest[slot])
        self._sum[slot] += value
        self._number[slot] += 1

    def points(self, first: int, last: int) -> list[Point]:
        """Return the steps from `first` to `last`, both included, that have any sample."""
        steps = range(max(first, self.newest - KEPT + 1), min(last, self.newest) + 1)
        return [self._point(step) for step in steps if self._place[step % KEPT] == step]

    def recent(self, seconds: int) -> list[Point]:
        """Return the finished steps of the last `seconds`."""
        return self.points(self.newest - seconds // STEP, self.newest - 1)

    def _point(self, step: int) -> Point:
        slot = step % KEPT
        number, bad = self._number[slot], self._bad[slot]
        if number == 0:
            return [step * STEP, None, None, None, bad]
        mean, least, greatest = self._sum[slot] / number, self._least[slot], self._greatest[slot]
        return [step * STEP, round(mean, 3), round(least, 3), round(greatest, 3), bad]
