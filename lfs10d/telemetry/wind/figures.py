"""The wind at one device as meteorologists count it (docs/wind.md): figures of the last minutes, totals of a span.

Pure.

Times are whole milliseconds of a clock that never goes back. A mean with less than half its window covered is None.
After a discontinuity (ICAO Annex 3, appendix 3, 4.1.3.1) only what came after it counts: the last 2 min, and the gusts
that lie wholly within them.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import field
from itertools import pairwise, starmap
from typing import Final

from lfs10d.reading import Number, Value
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.info import WindValues
from lfs10d.telemetry.wind.direction import VARIABLE_BELOW, VARIABLE_FROM, DirectionSeries, Vector
from lfs10d.telemetry.wind.extremes import Extremes, Peak
from lfs10d.telemetry.wind.speed import GUST_OVER, Mean, SpeedSeries

MINUTE: Final = 60_000
SHORT: Final = 2 * MINUTE
LONG: Final = 10 * MINUTE

METRES_PER_SECOND: Final = {"m/s": 1.0, "km/h": 1 / 3.6, "kn": 1852 / 3600, "mph": 0.44704, "ft/s": 0.3048}
"""What one of each unit is in m/s: a value in another has no statistics."""

DISCONTINUITY: Final = 5.0
"""m/s by which the mean of 2 min differs from that of the 10 min before (ICAO Annex 3, appendix 3, 4.1.3.1)."""

GUST_REPORTED: Final = 5.0
"""m/s by which a gust exceeds the mean of 10 min to be reported (ICAO Annex 3, appendix 3, 4.1.5.2)."""

TURBULENCE_FROM: Final = 5.0
"""m/s of the mean below which a turbulence intensity means nothing."""

CALM_BELOW: Final = 0.5
"""m/s of the mean below which the wind is calm (ICAO Annex 3, appendix 3, 4.1.5.2)."""

EXTREMES_FROM: Final = 1.5
"""m/s of the mean from which the extremes of a variable direction are reported (ICAO Annex 3, appendix 3, 4.1.5.2)."""

BEAUFORT: Final = (0.3, 1.6, 3.4, 5.5, 8.0, 10.8, 13.9, 17.2, 20.8, 24.5, 28.5, 32.7)
"""Lower bounds of the numbers 1 to 12 in m/s (WMO-No. 8, part I, 5.1.2)."""

SPEED_DECIMALS, RATIO_DECIMALS = 6, 4

_NUMBERS: Final = frozenset({int, float})
"""Types of values that are numbers; a boolean is none."""


@dataclass(slots=True)
class WindTotals:
    """What was measured in one span of time."""

    mean: Mean = field(default_factory=Mean)
    extremes: Extremes = field(default_factory=Extremes)
    vector: Vector = field(default_factory=Vector)
    directions: int = 0

    def add(self, other: WindTotals) -> None:
        """Take the span that follows as well."""
        self.mean.add(other.mean)
        self.extremes.add(other.extremes)
        self.vector.add(other.vector)
        self.directions += other.directions


class MeasuredWind:
    """The wind at a device with these values; `on_values` takes good ones alone."""

    def __init__(self, values: WindValues) -> None:
        self.values = values
        self._factor = METRES_PER_SECOND.get(values.unit or "", 1.0)
        self._speed = SpeedSeries()
        self._direction = DirectionSeries()
        inputs = ((values.speed, self._speed), (values.direction, self._direction))
        self._inputs = tuple((name, series.add) for name, series in inputs if name is not None)
        self._leading = self._direction if values.speed is None else self._speed
        """The series whose coverage is published: that of the speed, where there is one."""
        self.newest = 0
        """When the newest values were measured; 0: there are none."""

    def on_values(self, values: Mapping[str, Value | None], ages: Mapping[str, float], at: int, hold: int) -> None:
        """Take what was measured at `at`, but for values with an age, which are of an earlier poll.

        Each value holds until the next, for `hold` at most.
        """
        if at > self.newest:  # noqa: PLR1730 - a call would take longer; this is done for each sample
            self.newest = at
        for name, add in self._inputs:
            value = values.get(name)
            if type(value) in _NUMBERS and name not in ages:
                add(at, value, hold)  # type: ignore[arg-type] # a number

    def end(self, at: int) -> None:
        """Take that nothing holds beyond `at`: the device is no longer measured."""
        self._speed.end(at)
        self._direction.end(at)

    @property
    def held_until(self) -> int:
        """When the newest value holds no longer."""
        return self._leading.held_until

    def totals(self, begin: int, end: int) -> WindTotals:
        """Return what was measured within [begin, end)."""
        return WindTotals(
            self._speed.mean(begin, end),
            self._speed.extremes(begin, end),
            self._direction.vector(begin, end),
            self._direction.samples(begin, end),
        )

    def samples(self, totals: WindTotals) -> int:
        """Return how many values of the series were measured whose coverage is published."""
        return totals.directions if self.values.speed is None else totals.extremes.samples

    def covered(self, totals: WindTotals) -> int:
        """Return the milliseconds of that series."""
        return totals.vector.covered if self.values.speed is None else totals.mean.covered

    def figures(self, now: int, shift: int, *, undersampled: bool) -> dict[str, object]:
        """Return the figures of the topic `wind`; `shift` is the wall clock less the clock of `now`, in ms."""
        figures = self._speeds(now, shift, undersampled=undersampled)
        if self.values.direction is not None:
            figures.update(self._directions(now, figures["mean_10m"]))
        return figures

    def _speeds(self, now: int, shift: int, *, undersampled: bool) -> dict[str, object]:
        speed, factor = self._speed, self._factor
        edges = [speed.edge(now - each) for each in (SHORT + LONG, LONG, SHORT, 0)]
        oldest, older, newest = starmap(speed.between, pairwise(edges))
        short, before = speed.mean_of(newest), speed.mean_of(oldest.plus(older))
        apart = round(abs(short.mean - before.mean) * factor, SPEED_DECIMALS)
        discontinuity = apart >= DISCONTINUITY and _means(short, SHORT) and _means(before, LONG)
        window = SHORT if discontinuity else LONG
        long = short if discontinuity else speed.mean_of(older.plus(newest))
        whole = speed.extremes(now - LONG + 1, now + 1)
        peaks = speed.extremes(now - SHORT + GUST_OVER, now + 1) if discontinuity else whole
        gust, lull = (None, None) if undersampled else (peaks.gust, peaks.lull)
        last_gust = None if undersampled or now >= speed.held_until else speed.newest_gust()
        mean = round(long.mean, SPEED_DECIMALS) if _means(long, window) else None
        covered_2m, covered_10m, samples = short.covered, long.covered, whole.samples
        if self.values.speed is None:
            covered_2m, covered_10m = (self._direction.vector(now - each, now).covered for each in (SHORT, LONG))
            samples = self._direction.samples(now - LONG + 1, now + 1)
        return {
            "unit": self.values.unit,
            "mean_2m": round(short.mean, SPEED_DECIMALS) if _means(short, SHORT) else None,
            "mean_10m": mean,
            "gust_3s": None if last_gust is None else round(last_gust, SPEED_DECIMALS),
            "gust_10m": _speed(gust),
            "gust_10m_ts": None if gust is None else gust.at + shift,
            "lull_10m": _speed(lull),
            "lull_10m_ts": None if lull is None else lull.at + shift,
            "max_10m": whole.greatest,
            "stddev_10m": None if mean is None else round(long.deviation, SPEED_DECIMALS),
            **_judged(mean, long.deviation, gust, factor),
            "discontinuity": discontinuity,
            "samples_10m": samples,
            "coverage_2m": round(covered_2m / SHORT, RATIO_DECIMALS),
            "coverage_10m": round(covered_10m / LONG, RATIO_DECIMALS),
            "undersampled": undersampled,
        }

    def _directions(self, now: int, mean: object) -> dict[str, object]:
        direction = self._direction
        older, newest = starmap(direction.between, pairwise([direction.edge(now - each) for each in (LONG, SHORT, 0)]))
        short, long = direction.vector_of(newest), direction.vector_of(older.plus(newest))
        sector = direction.spread(now - LONG + 1, now + 1)
        variable = sector is not None and sector.degrees >= VARIABLE_FROM
        light = isinstance(mean, float) and mean * self._factor < EXTREMES_FROM
        extremes = sector if variable and not light and sector and sector.degrees < VARIABLE_BELOW else None
        steady = _means(long, LONG)
        return {
            "direction_2m": short.direction if _means(short, SHORT) else None,
            "direction_10m": long.direction if steady else None,
            "direction_stddev_10m": _degrees(long.deviation) if steady else None,
            "variable": variable,
            "direction_from": None if extremes is None else extremes.begin,
            "direction_to": None if extremes is None else extremes.end,
        }


def _means(of: Mean | Vector, window: int) -> bool:
    """Whether enough of the window is covered for a mean."""
    return 2 * of.covered >= window


def _judged(mean: float | None, deviation: float, gust: Peak | None, factor: float) -> dict[str, object]:
    """Return what a mean and a gust amount to; `factor` makes them m/s."""
    if mean is None:
        return {"turbulence_10m": None, "gust_reported": False, "beaufort": None, "calm": None}
    speed = mean * factor
    above = 0.0 if gust is None else gust.speed * factor - speed
    return {
        "turbulence_10m": None if speed < TURBULENCE_FROM else round(deviation / mean, RATIO_DECIMALS),
        "gust_reported": round(above, SPEED_DECIMALS) >= GUST_REPORTED,
        "beaufort": bisect_right(BEAUFORT, round(speed, 1)),
        "calm": speed < CALM_BELOW,
    }


def _speed(peak: Peak | None) -> float | None:
    return None if peak is None else round(peak.speed, SPEED_DECIMALS)


def _degrees(deviation: float | None) -> float | None:
    return None if deviation is None else round(deviation, 1)


def record_figures(totals: WindTotals, end: int, length: int, *, undersampled: bool) -> dict[str, Number]:
    """Return the figures of a record of `length` ms that ends at `end`, but for those that are null.

    The times of gust and lull are ms before `end`, so that a clock that is set right moves all of them.
    """
    mean, found, vector = totals.mean, totals.extremes, totals.vector
    gust, lull = (None, None) if undersampled else (found.gust, found.lull)
    steady, straight = _means(mean, length), _means(vector, length)
    figures: dict[str, Number | None] = {
        "mean": round(mean.mean, SPEED_DECIMALS) if steady else None,
        "gust": _speed(gust),
        "gust_before": None if gust is None else end - gust.at,
        "lull": _speed(lull),
        "lull_before": None if lull is None else end - lull.at,
        "max": found.greatest,
        "stddev": round(mean.deviation, SPEED_DECIMALS) if steady else None,
        "direction": vector.direction if straight else None,
        "direction_stddev": _degrees(vector.deviation) if straight else None,
    }
    return {name: figure for name, figure in figures.items() if figure is not None}
