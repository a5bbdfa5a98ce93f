"""Messages `wind` and `record` against a naive reference over the samples that were published.

A message is compared with all good samples up to the time that it says itself: `ts`, or `from` and `to`.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from tests.support.naive_wind import Good, Naive, sector, yamartino

SHORT, LONG = 120_000, 600_000
SIX_DECIMALS, FOUR_DECIMALS, ONE_DECIMAL = 5.01e-7, 5.01e-5, 0.0501
"""Half a unit of the last decimal that is published, and what adding up in another order makes of it."""

DEVIATION: Final = 2e-6
"""A standard deviation near 0 is the root of a difference."""

HALF_DEGREE = 0.5 + 1e-6
JUMP: Final = 5.0
"""m/s of a discontinuity, of a gust that is reported, and of the least mean that has a turbulence."""

CALM, NO_DIRECTION, VARIABLE = 0.5, 0.05, 60
GUST = 3000
BEAUFORT = (0.3, 1.6, 3.4, 5.5, 8.0, 10.8, 13.9, 17.2, 20.8, 24.5, 28.5, 32.7)
CLOSE: Final = 1e-3
"""Within that of a limit either side of it is right."""

EQUAL: Final = 1e-9
"""Means of the same values, added up in another order."""


class Measured:
    """The good values of one device, in order of time."""

    def __init__(self, values: Iterable[Good]) -> None:
        self.values = sorted(values)
        self._times = [at for at, _, _ in self.values]
        self._gusts = [self._gust_at(place) for place in range(len(self.values))]

    def between(self, begin: int, end: int) -> Naive:
        """Return what was measured up to `end`, both included, and what may hold at `begin`."""
        first = max(0, bisect_left(self._times, begin) - 1)
        return Naive(self.values[first : bisect_right(self._times, end)])

    def gusts(self, begin: int, end: int) -> list[tuple[float, int]]:
        """Return the means of 3 s taken within [begin, end), each with its time."""
        places = range(bisect_left(self._times, begin), bisect_left(self._times, end))
        return [(gust, self._times[place]) for place in places if (gust := self._gusts[place]) is not None]

    def newest_gust(self, at: int) -> float | None:
        """Return the mean of 3 s that was taken last at `at`, if its value holds still."""
        place = bisect_right(self._times, at) - 1
        holds = place >= 0 and self._times[place] + self.values[place][2] > at
        return self._gusts[place] if holds else None

    def _gust_at(self, place: int) -> float | None:
        first = bisect_right(self._times, self._times[place] - GUST)
        return Naive(self.values[first : place + 1]).gust_at(place - first)


@dataclass(frozen=True)
class Difference:
    """A figure of a message that is not the reference's."""

    message: Mapping[str, Any]
    name: str
    expected: object

    def __str__(self) -> str:
        device, ts = self.message["device"], self.message["ts"]
        return f"{device} at {ts}: {self.name} is {self.message[self.name]}, by the reference {self.expected}"


class Comparison:
    """Counts the `figures` that were compared; keeps the differences."""

    def __init__(self) -> None:
        self.figures = 0
        self.differences: list[Difference] = []

    def _say(self, message: Mapping[str, Any], name: str, expected: object, *, right: bool) -> None:
        self.figures += 1
        if not right:
            self.differences.append(Difference(message, name, expected))

    def equal(self, message: Mapping[str, Any], name: str, expected: object) -> None:
        """Compare a figure that is exact."""
        self._say(message, name, expected, right=message[name] == expected)

    def near(self, message: Mapping[str, Any], name: str, expected: float | None, within: float) -> None:
        """Compare a rounded number."""
        found = message[name]
        right = found is None if expected is None else found is not None and abs(found - expected) <= within
        self._say(message, name, expected, right=right)

    def peak(
        self, message: Mapping[str, Any], name: str, gusts: Sequence[tuple[float, int]], *, greatest: bool
    ) -> None:
        """Compare a gust or lull and its time: of equal ones any time counts."""
        if not gusts:
            self.equal(message, name, None)
            self.equal(message, f"{name}_ts", None)
            return
        speed = max(gusts)[0] if greatest else min(gusts)[0]
        self.near(message, name, speed, SIX_DECIMALS)
        times = [at for gust, at in gusts if abs(gust - speed) < EQUAL]
        self._say(message, f"{name}_ts", times, right=message[f"{name}_ts"] in times)

    def direction(self, message: Mapping[str, Any], name: str, expected: float | None) -> None:
        """Compare a direction in whole degrees."""
        found = message[name]
        if expected is None or found is None:
            self.equal(message, name, expected)
        else:
            self._say(message, name, expected, right=abs((found - expected + 180) % 360 - 180) <= HALF_DEGREE)


def compare_wind(made: Comparison, message: Mapping[str, Any], measured: Measured, *, undersampled: bool) -> None:
    """Compare a message of the topic `wind` with the speeds of its device."""
    ts = message["ts"]
    naive = measured.between(ts - SHORT - LONG, ts)
    short, before = _mean(naive, ts - SHORT, ts), _mean(naive, ts - SHORT - LONG, ts - SHORT)
    apart = 0.0 if short is None or before is None else abs(short - before)
    discontinuity = message["discontinuity"] if abs(apart - JUMP) < CLOSE else apart > JUMP
    begin = ts - (SHORT if discontinuity else LONG)
    mean = _mean(naive, begin, ts)
    deviation = None if mean is None else naive.deviation(begin, ts)
    gusts = [] if undersampled else measured.gusts(begin + (GUST if discontinuity else 1), ts + 1)
    values = [value for _, value, _ in naive.measured(ts - LONG + 1, ts + 1)]
    made.near(message, "mean_2m", short, SIX_DECIMALS)
    made.near(message, "mean_10m", mean, SIX_DECIMALS)
    made.near(message, "gust_3s", None if undersampled else measured.newest_gust(ts), SIX_DECIMALS)
    made.peak(message, "gust_10m", gusts, greatest=True)
    made.peak(message, "lull_10m", gusts, greatest=False)
    made.equal(message, "max_10m", max(values, default=None))
    made.near(message, "stddev_10m", deviation, DEVIATION)
    made.equal(message, "discontinuity", discontinuity)
    made.equal(message, "samples_10m", len(values))
    made.near(message, "coverage_2m", naive.covered(ts - SHORT, ts) / SHORT, FOUR_DECIMALS)
    made.near(message, "coverage_10m", naive.covered(begin, ts) / LONG, FOUR_DECIMALS)
    made.equal(message, "undersampled", undersampled)
    if mean is None or deviation is None:
        for name, figure in (("turbulence_10m", None), ("gust_reported", False), ("beaufort", None), ("calm", None)):
            made.equal(message, name, figure)
        return
    made.near(message, "turbulence_10m", deviation / mean if mean >= JUMP else None, FOUR_DECIMALS)
    above = max(gusts)[0] - mean if gusts else 0.0
    made.equal(message, "gust_reported", message["gust_reported"] if abs(above - JUMP) < CLOSE else above > JUMP)
    made.equal(message, "beaufort", bisect_right(BEAUFORT, round(round(mean, 6), 1)))
    made.equal(message, "calm", round(mean, 6) < CALM)


def compare_record(made: Comparison, message: Mapping[str, Any], measured: Measured, *, undersampled: bool) -> None:
    """Compare a record with the speeds of its device."""
    begin, end = message["from"], message["to"]
    naive = measured.between(begin, end - 1)
    mean, values = _mean(naive, begin, end), [value for _, value, _ in naive.measured(begin, end)]
    gusts = [] if undersampled else measured.gusts(begin, end)
    made.equal(message, "ts", end)
    made.near(message, "mean", mean, SIX_DECIMALS)
    made.peak(message, "gust", gusts, greatest=True)
    made.peak(message, "lull", gusts, greatest=False)
    made.equal(message, "max", max(values, default=None))
    made.near(message, "stddev", None if mean is None else naive.deviation(begin, end), DEVIATION)
    made.equal(message, "samples", len(values))
    made.near(message, "coverage", naive.covered(begin, end) / (end - begin), FOUR_DECIMALS)


def compare_directions(made: Comparison, message: Mapping[str, Any], measured: Measured) -> None:
    """Compare the directions in a message of the topic `wind` with those of its device."""
    ts = message["ts"]
    naive = measured.between(ts - LONG, ts)
    for name, window in (("direction_2m", SHORT), ("direction_10m", LONG)):
        steady = 2 * naive.covered(ts - window, ts) >= window
        north, east = naive.vector(ts - window, ts) if steady else (0.0, 0.0)
        expected = math.degrees(math.atan2(east, north)) if math.hypot(north, east) >= NO_DIRECTION else None
        made.direction(message, name, expected)
        if window == LONG:
            made.near(message, "direction_stddev_10m", yamartino(north, east) if steady else None, ONE_DECIMAL)
    seen = [round(value) for _, value, _ in naive.measured(ts - LONG + 1, ts + 1)]
    made.equal(message, "variable", bool(seen) and sector(seen) >= VARIABLE)


def _mean(naive: Naive, begin: int, end: int) -> float | None:
    covered = naive.covered(begin, end)
    return naive.mean(begin, end) if covered and 2 * covered >= end - begin else None
