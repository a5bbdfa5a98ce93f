"""The figures of a wind, by the definitions of the contract."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from lfs10d.telemetry.info import WindValues
from lfs10d.telemetry.wind.figures import (
    LONG,
    METRES_PER_SECOND,
    SHORT,
    MeasuredWind,
    WindTotals,
    record_figures,
)

T = 1_000_000_000
SHIFT = 794_000_000_000
HOLD = 2000
SPEED = WindValues("wind_speed", None, "m/s")
BOTH = WindValues("wind_speed", "wind_direction", "m/s")
VANE = WindValues(None, "wind_direction", None)


def measured(
    speed: Callable[[float], float],
    seconds: int = 900,
    *,
    values: WindValues = SPEED,
    step: int = 250,
    direction: Callable[[float], float] | None = None,
) -> tuple[MeasuredWind, int]:
    """Return a wind measured for some seconds, and the time at which the last value has held as long as the others."""
    wind, count = MeasuredWind(values), seconds * 1000 // step
    for place in range(count):
        now = place * step / 1000
        found = {"wind_speed": speed(now)}
        if direction is not None:
            found["wind_direction"] = direction(now)
        wind.on_values(found, {}, T + place * step, HOLD)
    return wind, T + count * step


def figures(of: tuple[MeasuredWind, int], *, undersampled: bool = False, later: int = 0) -> dict[str, object]:
    wind, end = of
    return wind.figures(end + later, SHIFT, undersampled=undersampled)


def pick(found: dict[str, object], *names: str) -> tuple[object, ...]:
    return tuple(found[name] for name in names)


# -- speeds -------------------------------------------------------------------------------------------------------


def test_a_pulse_of_3_s_is_a_gust_and_moves_the_mean_of_10_min_a_little() -> None:
    found = figures(measured(lambda now: 20.0 if 600 <= now < 603 else 5.0))
    assert pick(found, "mean_10m", "gust_10m", "max_10m", "lull_10m", "gust_3s") == (5.075, 20.0, 20.0, 5.0, 5.0)
    assert found["gust_10m_ts"] == T + SHIFT + 602_750
    assert pick(found, "gust_reported", "beaufort", "calm", "discontinuity") == (True, 3, False, False)
    assert pick(found, "samples_10m", "coverage_2m", "coverage_10m", "undersampled") == (2399, 1.0, 1.0, False)
    assert found["stddev_10m"] == pytest.approx(math.sqrt(225 * (3 / 600) * (597 / 600)), abs=1e-6)
    assert found["turbulence_10m"] == pytest.approx(1.058_005 / 5.075, abs=1e-4)


def test_before_anything_is_measured_nothing_is_known_and_it_is_not_calm() -> None:
    empty = MeasuredWind(SPEED)
    found = empty.figures(T, SHIFT, undersampled=False)
    assert {name for name, figure in found.items() if figure is None} == {
        "mean_2m", "mean_10m", "gust_3s", "gust_10m", "gust_10m_ts", "lull_10m", "lull_10m_ts", "max_10m",
        "stddev_10m", "turbulence_10m", "beaufort", "calm",
    }  # fmt: skip
    assert pick(found, "coverage_2m", "coverage_10m", "samples_10m", "gust_reported") == (0.0, 0.0, 0, False)
    assert found["unit"] == "m/s"


def test_values_dated_before_the_newest_count_as_new() -> None:
    wind = MeasuredWind(SPEED)
    wind.on_values({"wind_speed": 4.0}, {}, T, HOLD)
    wind.on_values({"wind_speed": 6.0}, {}, T - 300, HOLD)
    assert wind.newest == T
    assert wind.figures(T + 1, SHIFT, undersampled=False)["samples_10m"] == 2


def test_a_mean_is_null_until_half_its_window_is_covered() -> None:
    assert pick(figures(measured(lambda _: 4.0, 59)), "mean_2m", "mean_10m") == (None, None)
    assert pick(figures(measured(lambda _: 4.0, 60)), "mean_2m", "mean_10m") == (4.0, None)
    half = figures(measured(lambda _: 4.0, 300))
    assert pick(half, "mean_10m", "stddev_10m", "coverage_10m") == (4.0, 0.0, 0.5)
    assert half["turbulence_10m"] is None  # below 5 m/s


def test_an_outage_is_a_gap_and_no_calm() -> None:
    found = figures(measured(lambda _: 8.0), later=200_000)
    assert pick(found, "mean_10m", "coverage_10m") == (8.0, round((600 - 200 + 1.75) / 600, 4))
    assert pick(found, "mean_2m", "coverage_2m", "gust_3s", "gust_10m") == (None, 0.0, None, 8.0)
    assert pick(figures(measured(lambda _: 8.0), later=700_000), "gust_10m", "max_10m", "samples_10m") == (
        None, None, 0,
    )  # fmt: skip


def test_above_1_s_there_is_no_gust_and_no_lull() -> None:
    found = figures(measured(lambda now: 20.0 if 600 <= now < 603 else 5.0, step=1000), undersampled=True)
    assert pick(found, "gust_3s", "gust_10m", "gust_10m_ts", "lull_10m", "lull_10m_ts") == (None,) * 5
    assert pick(found, "max_10m", "gust_reported", "undersampled") == (20.0, False, True)


def test_a_gust_is_reported_from_5_above_the_mean_on() -> None:
    def gusty(by: float) -> dict[str, object]:
        return figures(measured(lambda now: 10.0 + by if 600 <= now < 603 else 10.0))

    mean = 3 / 600
    assert gusty(5.0 / (1 - mean) + 1e-5)["gust_reported"] is True
    assert gusty(5.0 / (1 - mean) - 1e-5)["gust_reported"] is False


@pytest.mark.parametrize(
    ("mean", "beaufort"),
    [(0.0, 0), (0.24, 0), (0.26, 1), (1.5, 1), (1.6, 2), (3.4, 3), (5.5, 4), (8.0, 5), (10.8, 6), (13.9, 7),
     (17.2, 8), (20.8, 9), (24.5, 10), (28.5, 11), (32.64, 11), (32.66, 12), (60.0, 12)],
)  # fmt: skip
def test_beaufort_is_that_of_the_mean_of_10_min_to_a_tenth(mean: float, beaufort: int) -> None:
    assert figures(measured(lambda _: mean, 400, step=1000))["beaufort"] == beaufort


@pytest.mark.parametrize(("mean", "calm"), [(0.0, True), (0.49, True), (0.5, False)])
def test_below_half_a_metre_a_second_it_is_calm(mean: float, calm: bool) -> None:  # noqa: FBT001 - a case
    assert figures(measured(lambda _: mean, 400, step=1000))["calm"] is calm


@pytest.mark.parametrize("unit", METRES_PER_SECOND)
def test_speeds_stay_in_their_unit_and_are_judged_in_metres_per_second(unit: str) -> None:
    factor = METRES_PER_SECOND[unit]
    values = WindValues("wind_speed", None, unit)
    speed = figures(measured(lambda now: (26.0 if 600 <= now < 603 else 12.0) / factor, values=values))
    assert pick(speed, "unit", "beaufort", "calm", "gust_reported") == (unit, 6, False, True)
    assert speed["mean_10m"] == pytest.approx(12.07 / factor)
    assert speed["turbulence_10m"] is not None


# -- discontinuity ------------------------------------------------------------------------------------------------


def test_after_a_discontinuity_only_the_last_2_min_count() -> None:
    found = figures(measured(lambda now: 4.0 if now < 780 else 12.0 + (now % 2)))
    assert found["discontinuity"] is True
    assert pick(found, "mean_2m", "mean_10m") == (12.875, 12.875)
    assert pick(found, "lull_10m", "coverage_10m") == (pytest.approx(12.75, abs=0.2), 0.2)
    assert pick(found, "max_10m", "samples_10m") == (13.75, 2399)
    assert found["stddev_10m"] == pytest.approx(0.572_822, abs=1e-5)
    assert found["lull_10m_ts"] is not None


@pytest.mark.parametrize(("step", "discontinuity"), [(5.0, True), (-5.0, True), (4.99, False), (-4.99, False)])
def test_a_difference_of_5_either_way_is_one(step: float, discontinuity: bool) -> None:  # noqa: FBT001 - a case
    found = figures(measured(lambda now: 10.0 if now < 780 else 10.0 + step))
    assert found["discontinuity"] is discontinuity


def test_too_little_before_shows_no_discontinuity() -> None:
    found = figures(measured(lambda now: 4.0 if now < 280 else 12.0, 400))
    assert pick(found, "discontinuity", "coverage_10m") == (False, round(400 / 600, 4))


def test_once_the_old_wind_weighs_less_it_is_none_any_more() -> None:
    assert figures(measured(lambda now: 4.0 if now < 300 else 12.0, 900))["discontinuity"] is False


# -- values -------------------------------------------------------------------------------------------------------


def test_values_that_are_absent_null_of_an_earlier_poll_or_no_numbers_are_passed_over() -> None:
    wind = MeasuredWind(BOTH)
    wind.on_values({"wind_speed": None, "wind_direction": 90.0}, {}, T, HOLD)
    wind.on_values({"wind_direction": 90.0}, {}, T + 1, HOLD)
    wind.on_values({"wind_speed": 3.0, "wind_direction": 90.0}, {"wind_speed": 20.0}, T + 2, HOLD)
    wind.on_values({"wind_speed": "strong"}, {}, T + 3, HOLD)
    totals = wind.totals(T, T + 10)
    assert (wind.samples(totals), totals.directions, totals.extremes.samples) == (0, 3, 0)
    assert wind.held_until == 0
    wind.on_values({"wind_speed": 3.0}, {}, T + 4, HOLD)
    assert wind.held_until == T + 4 + HOLD
    wind.end(T + 5)
    assert wind.held_until == T + 5


# -- directions ---------------------------------------------------------------------------------------------------


def test_a_vane_has_directions_beside_the_speed() -> None:
    found = figures(measured(lambda _: 6.0, values=BOTH, step=1000, direction=lambda now: 350.0 if now % 2 else 30.0))
    assert pick(found, "direction_2m", "direction_10m", "variable") == (10, 10, False)
    assert pick(found, "direction_from", "direction_to") == (None, None)
    assert found["direction_stddev_10m"] == pytest.approx(20.3, abs=0.3)


def test_directions_that_vary_by_60_or_more_are_variable_with_their_extremes_through_north() -> None:
    found = figures(measured(lambda _: 6.0, values=BOTH, step=1000, direction=lambda now: (330 + now % 91) % 360))
    assert pick(found, "variable", "direction_from", "direction_to") == (True, 330, 60)


def test_from_180_on_no_extremes_are_reported_and_in_light_wind_neither() -> None:
    wide = figures(measured(lambda _: 6.0, values=BOTH, step=1000, direction=lambda now: now % 181))
    assert pick(wide, "variable", "direction_from", "direction_to") == (True, None, None)
    light = figures(measured(lambda _: 1.4, values=BOTH, step=1000, direction=lambda now: now % 91))
    assert pick(light, "variable", "direction_from", "direction_to") == (True, None, None)


def test_a_vane_alone_has_directions_coverage_and_no_speed() -> None:
    found = figures(measured(lambda _: 6.0, values=VANE, step=1000, direction=lambda now: now % 91))
    assert pick(found, "direction_10m", "variable", "direction_from", "direction_to") == (46, True, 360, 90)
    assert pick(found, "unit", "mean_10m", "max_10m", "calm", "beaufort", "gust_reported") == (
        None, None, None, None, None, False,
    )  # fmt: skip
    assert pick(found, "samples_10m", "coverage_2m", "coverage_10m") == (599, 1.0, 1.0)
    totals = measured(lambda _: 6.0, 60, values=VANE, step=1000, direction=lambda _: 5.0)[0].totals(T, T + 60_000)
    assert MeasuredWind(VANE).samples(totals) == 60
    assert MeasuredWind(VANE).covered(totals) == 60_000


def test_a_direction_is_null_until_half_its_window_is_covered_and_where_directions_cancel_out() -> None:
    short = figures(measured(lambda _: 6.0, 100, values=BOTH, step=1000, direction=lambda _: 90.0))
    assert pick(short, "direction_2m", "direction_10m", "direction_stddev_10m") == (90, None, None)
    early = figures(measured(lambda _: 6.0, 50, values=BOTH, step=1000, direction=lambda _: 90.0))
    assert early["direction_2m"] is None
    none = figures(measured(lambda _: 6.0, values=BOTH, step=1000, direction=lambda now: 90.0 + 180 * (now % 2)))
    assert pick(none, "direction_2m", "direction_10m") == (None, None)
    assert none["direction_stddev_10m"] == pytest.approx(103.9, abs=0.1)


# -- records ------------------------------------------------------------------------------------------------------


def test_the_figures_of_a_record_are_those_of_its_span_with_times_before_its_end() -> None:
    wind, _ = measured(lambda now: 20.0 if 600 <= now < 603 else 5.0, values=BOTH, direction=lambda _: 90.0)
    first, second = wind.totals(T + 300_000, T + 500_000), wind.totals(T + 500_000, T + 900_000)
    whole = WindTotals()
    whole.add(first)
    whole.add(second)
    found = record_figures(whole, T + 900_000, LONG, undersampled=False)
    assert found == {
        "mean": 5.075, "gust": 20.0, "gust_before": 297_250, "lull": 5.0, "lull_before": 250, "max": 20.0,
        "stddev": pytest.approx(1.058_005, abs=1e-6), "direction": 90, "direction_stddev": 0.0,
    }  # fmt: skip
    assert wind.samples(whole) == 2400
    assert wind.covered(whole) == LONG
    assert record_figures(whole, T + 900_000, 3 * LONG, undersampled=True) == {"max": 20.0}


def test_a_span_without_values_has_no_figures() -> None:
    assert record_figures(MeasuredWind(BOTH).totals(T, T + SHORT), T + SHORT, SHORT, undersampled=False) == {}
