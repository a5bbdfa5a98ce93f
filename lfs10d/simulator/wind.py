"""Sources of simulated values: moving wind, or numbers that are unique in a run.

Both are plain decimals of few digits, so a value read back from a float32 by its shortest decimal is equal.
"""

from __future__ import annotations

import math
from random import Random
from typing import Final, Protocol

from lfs10d.simulator.wire import SECOND

UNIQUE_VALUES: Final = 1_000_000
_STRIDE: Final = 618_033  # prime to UNIQUE_VALUES: scatters the values, repeats none


class WindSource(Protocol):
    """Something that yields a sensor's next value at a time in nanoseconds."""

    def __call__(self, now: int) -> float:
        """Return the value measured at `now`."""


class Unique:
    """Values in 0..99.9999 that never repeat within a million answers: who published what can be proved."""

    def __init__(self) -> None:
        self.drawn = 0

    def __call__(self, now: int) -> float:  # noqa: ARG002  # a Source; these do not depend on the time
        """Return the next one."""
        self.drawn += 1
        return self.drawn * _STRIDE % UNIQUE_VALUES / 10_000


class Wind:
    """Wind speed in m/s with two decimals: a mean that wanders, turbulence and gusts; the same for one seed."""

    def __init__(self, seed: int, mean: float = 6.0) -> None:
        random = Random(seed)  # noqa: S311  # weather, no secret
        self._mean = mean
        self._waves = tuple(
            (share * mean, 2 * math.pi / (period * random.uniform(0.9, 1.1)), random.uniform(0, 2 * math.pi))
            for share, period in ((0.35, 97.0), (0.22, 23.0), (0.12, 7.1), (0.06, 2.3))
        )
        self._gust = (2 * math.pi / random.uniform(50.0, 70.0), random.uniform(0, 2 * math.pi))

    def __call__(self, now: int) -> float:
        """Return the wind speed at `now`."""
        seconds = now / SECOND
        speed = self._mean + sum(high * math.sin(pace * seconds + phase) for high, pace, phase in self._waves)
        pace, phase = self._gust
        gust = max(0.0, math.sin(pace * seconds + phase)) ** 8
        return round(max(0.0, speed + 0.8 * self._mean * gust), 2)
