"""Means, gusts and lulls of a speed, against closed forms and a naive reference."""

from __future__ import annotations

import math
from array import array

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.telemetry.wind.extremes import Extremes
from lfs10d.telemetry.wind.series import BLOCK, REACH, HeldSeries
from lfs10d.telemetry.wind.speed import Mean, SpeedSeries
from tests.support.naive_wind import Good, Naive

T = 1_000_000_000
STEP = 250
HOLD = 2000


def series(values: list[Good]) -> SpeedSeries:
    filled = SpeedSeries()
    for at, value, hold in values:
        filled.add(at, value, hold)
    return filled


def four_hertz(speed: list[float], begin: int = T) -> tuple[SpeedSeries, int]:
    """Return a series of these speeds, one each 250 ms, and when the last was measured."""
    return series([(begin + STEP * place, value, HOLD) for place, value in enumerate(speed)]), begin + STEP * (
        len(speed) - 1
    )


def gusts(of: SpeedSeries, end: int, over: int = 600_000) -> Extremes:
    return of.extremes(end - over + 1, end + 1)


# -- closed forms -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("pulse", "gust"), [(3, 20.0), (1, 10.0)])
def test_the_gust_of_a_pulse_of_20_above_5_is_its_mean_over_3_s(pulse: int, gust: float) -> None:
    speeds = [20.0 if 1000 <= place < 1000 + 4 * pulse else 5.0 for place in range(2400)]
    filled, end = four_hertz(speeds)
    found = gusts(filled, end)
    assert found.gust is not None
    assert found.gust.speed == pytest.approx(gust)
    assert T + STEP * (1000 + 4 * pulse - 1) <= found.gust.at <= T + STEP * 1011
    assert found.greatest == 20.0
    assert filled.mean(end + STEP - 600_000, end + STEP).mean == pytest.approx(5 + 15 * pulse / 600)


def test_the_gust_of_a_sine_of_20_s_is_damped_by_its_3_s() -> None:
    # half a step late, so that the twelve values of one window lie evenly about the crest
    speeds = [10 + 4 * math.sin(2 * math.pi * (place + 0.5) * 0.25 / 20) for place in range(2400)]
    found = gusts(*four_hertz(speeds))
    assert found.gust is not None
    assert found.lull is not None
    assert found.gust.speed == pytest.approx(13.8546, abs=5e-5)
    assert found.lull.speed == pytest.approx(20 - found.gust.speed)


def test_the_gust_of_a_ramp_lies_half_a_window_behind_its_end() -> None:
    speeds = [place * 0.25 / 60 for place in range(2400)]
    filled, end = four_hertz(speeds)
    found = gusts(filled, end)
    assert found.gust is not None
    assert found.gust.at == end
    assert found.gust.speed == pytest.approx(speeds[-1] - 5.5 * 0.25 / 60)


def test_a_constant_wind_has_no_deviation_at_all() -> None:
    filled, end = four_hertz([60.1] * 3000)
    found = filled.mean(end - 600_000, end)
    assert (found.mean, found.deviation) == (60.1, 0.0)


# -- the rules ----------------------------------------------------------------------------------------------------


def test_a_gust_needs_three_values_within_3_s() -> None:
    filled = series([(T, 5.0, HOLD), (T + 1000, 6.0, HOLD)])
    assert filled.newest_gust() is None
    filled.add(T + 2000, 7.0, HOLD)
    assert filled.newest_gust() == pytest.approx(6.0)
    filled.add(T + 3000, 11.0, HOLD)  # the first is 3 s old: no longer within
    assert filled.newest_gust() == pytest.approx(8.0)


def test_no_gust_is_taken_over_a_gap_and_behind_it_the_next_from_its_own_values() -> None:
    filled = series([(T, 5.0, 300), (T + 500, 9.0, 300), (T + 700, 9.0, 300), (T + 900, 9.0, 300)])
    assert filled.newest_gust() is None  # the gap from 300 to 500 lies between the first and the others
    filled.add(T + 1100, 9.0, 2000)
    assert filled.newest_gust() is None
    filled.add(T + 3050, 12.0, 2000)  # the first is out of the window, the gap is before all others
    assert filled.newest_gust() == pytest.approx((9 * 4 + 12) / 5)


def test_two_gaps_within_3_s_spoil_no_later_gust() -> None:
    filled = series([(T, 5.0, 100), (T + 500, 6.0, 100), (T + 1000, 7.0, 2000)])
    for place in range(1, 5):
        filled.add(T + 1000 + 1000 * place, 7.0, 2000)
    assert filled.newest_gust() == pytest.approx(7.0)
    assert filled.extremes(T, T + 10_000).greatest == 7.0


def test_a_value_holds_until_the_next_and_no_longer_than_it_may() -> None:
    filled = series([(T, 4.0, 2000), (T + 5000, 8.0, 2000)])
    assert filled.mean(T, T + 10_000) == Mean(4000, 6.0, 4.0 * 4000)
    assert filled.mean(T + 1000, T + 5000) == Mean(1000, 4.0, 0.0)
    assert filled.mean(T + 2000, T + 5000) == Mean()
    assert filled.mean(T - 9000, T) == Mean()
    assert filled.mean(T + 8000, T + 9000) == Mean()
    assert Mean().deviation == 0.0


def test_a_series_that_is_ended_holds_no_longer_but_what_was_measured_stays() -> None:
    filled = series([(T, 4.0, 2000)])
    filled.end(T + 500)
    assert filled.mean(T, T + 2000).covered == 500
    filled.end(T + 1500)
    assert filled.held_until == T + 500
    filled.end(T - 1)
    assert filled.held_until == T
    assert filled.extremes(T, T + 1).samples == 1


def test_an_empty_series_has_nothing() -> None:
    empty = SpeedSeries()
    assert empty.mean(T, T + 1000) == Mean()
    assert empty.extremes(T, T + 1000) == Extremes()
    assert empty.newest_gust() is None


def test_a_value_dated_before_the_newest_counts_as_new() -> None:
    filled = series([(T, 4.0, 2000), (T - 300, 6.0, 2000)])
    assert filled.newest == T
    assert filled.mean(T, T + 1000) == Mean(1000, 6.0, 0.0)


def test_after_a_silence_longer_than_all_windows_a_series_begins_anew() -> None:
    filled, end = four_hertz([5.0] * 100)
    later = end + REACH + 10 * HOLD
    filled.add(later, 7.0, HOLD)
    assert len(filled._times) == 1
    assert filled.mean(later, later + 1000).mean == 7.0


def test_times_go_on_over_the_32_bits_in_which_they_are_kept() -> None:
    begin = T
    filled = series([(begin, 5.0, HOLD)])
    filled._origin -= 2**31 - 10_000  # as if it had begun 24 days ago
    filled._times[0] += 2**31 - 10_000
    for place in range(1, 400):
        filled.add(begin + STEP * place, 5.0, HOLD)
    assert filled._origin >= begin
    assert filled.mean(begin, begin + STEP * 400).covered == STEP * 400
    assert filled.extremes(begin, begin + STEP * 400).samples == 400


def columns(of: HeldSeries) -> list[array[int] | array[float] | bytearray]:
    names = [name for kind in type(of).__mro__[:-1] for name in getattr(kind, "__slots__", ())]
    return [column for name in names if isinstance(column := getattr(of, name), array | bytearray)]


@pytest.mark.parametrize(("thousandths", "most"), [(10, 9.9), (1 / 3, 13.9)])
def test_memory_is_bounded_and_small_whatever_the_wind_does(thousandths: float, most: float) -> None:
    filled, _ = four_hertz([place * thousandths / 1000 for place in range(40_000)])
    kept = REACH // STEP
    assert len(filled._times) <= kept + 3 * BLOCK + 1
    size = sum(len(column) * memoryview(column).itemsize for column in columns(filled))
    assert size < most * (kept + 3 * BLOCK)


def test_a_value_that_is_no_whole_hundred_thousandth_changes_no_figure_of_those_before() -> None:
    speeds = [round(8 + 3 * math.sin(place / 9), 2) for place in range(500)]
    values = [(T + STEP * place + (9000 if place > 200 else 0), speed, HOLD) for place, speed in enumerate(speeds)]
    filled, naive, end = series(values), Naive(values), values[-1][0]
    before = filled.mean(T, end), filled.extremes(T, end + 1)
    filled.add(end + STEP, math.pi, HOLD)
    assert (filled.mean(T, end), filled.extremes(T, end + 1)) == before
    assert filled.extremes(end, end + STEP + 1).samples == 2
    assert filled.extremes(end + 1, end + STEP + 1).greatest == math.pi
    compare(filled, Naive([*values, (end + STEP, math.pi, HOLD)]), T + 1000, end + STEP)
    assert naive.values == values


@pytest.mark.parametrize("value", [20_000.0, 1e300])
def test_a_value_beyond_32_bits_is_kept_as_it_is(value: float) -> None:
    filled = series([(T, 1.0, HOLD), (T + 1000, value, HOLD)])
    assert filled.extremes(T, T + 2000).greatest == value


# -- sums of windows ----------------------------------------------------------------------------------------------


def test_two_windows_amount_to_their_whole() -> None:
    filled, end = four_hertz([(place * 7 % 31) / 3 for place in range(2000)])
    begin, middle = T + 7777, T + 123_456
    whole = filled.mean(begin, end)
    parts = filled.mean(begin, middle)
    parts.add(filled.mean(middle, end))
    parts.add(Mean())
    assert parts.covered == whole.covered
    assert [parts.mean, parts.deviation] == pytest.approx([whole.mean, whole.deviation])
    found = filled.extremes(begin, middle)
    found.add(filled.extremes(middle, end))
    assert found == filled.extremes(begin, end)


@pytest.mark.parametrize("thousandths", [1, 1 / 3])
def test_any_window_of_a_long_series_with_gaps_is_counted_as_a_naive_reference_counts_it(thousandths: float) -> None:
    at, values = T, []
    for place in range(300):
        at += 9000 if place % 47 == 46 else 250 + place % 7
        values.append((at, 8 + (place * 37 % 101) * thousandths / 10, 300 if place % 53 == 52 else HOLD))
    filled, naive = series(values), Naive(values)
    for begin in range(T - 500, at + 3000, 1499):
        for end in (begin + 400, begin + 4000, begin + 31_000, at - 700, at + 1):
            if begin < end:
                compare(filled, naive, begin, end)


def test_a_value_of_any_size_leaves_nothing_behind_in_later_windows() -> None:
    values = [(T + STEP * place, 1e30 if place == 40 else 5 + place % 3 / 3, HOLD) for place in range(200)]
    filled, naive, end = series(values), Naive(values), T + STEP * 199
    for begin in range(T + STEP * 41, end, STEP):
        mean = filled.mean(begin, end)
        assert mean.covered == naive.covered(begin, end)
        assert mean.mean == pytest.approx(naive.mean(begin, end), abs=1e-9)
    newest = naive.gust_at(199)
    assert filled.newest_gust() == pytest.approx(newest)
    gust = gusts(filled, end, 36_000).gust
    assert gust is not None
    assert gust.speed == pytest.approx(max(each for each, _ in naive.gusts(end - 35_999, end + 1)))


# -- a naive reference ----------------------------------------------------------------------------------------------

steps = st.one_of(st.integers(1, 900), st.just(250), st.integers(900, 8000), st.just(3000), st.just(0))
speeds = st.one_of(st.integers(0, 4000).map(lambda each: each / 100), st.floats(0, 100))


@given(
    st.lists(st.tuples(steps, speeds, st.sampled_from([2000, 2500])), min_size=1, max_size=120),
    st.lists(st.tuples(st.integers(-5000, 300_000), st.integers(1, 700_000)), min_size=1, max_size=2),
)
def test_irregular_series_with_gaps_are_counted_as_a_naive_reference_counts_them(
    drawn: list[tuple[int, float, int]], windows: list[tuple[int, int]]
) -> None:
    at, values = T, []
    for step, speed, hold in drawn:
        at += step
        values.append((at, speed, hold))
    naive, filled = Naive(values), series(values)
    for begin, length in windows:
        compare(filled, naive, T + begin, T + begin + length)
    newest = naive.gust_at(len(values) - 1)
    assert filled.newest_gust() == (None if newest is None else pytest.approx(newest))


def compare(filled: SpeedSeries, naive: Naive, begin: int, end: int) -> None:
    mean, found, measured = filled.mean(begin, end), filled.extremes(begin, end), naive.measured(begin, end)
    assert mean.covered == naive.covered(begin, end)
    if mean.covered:
        assert mean.mean == pytest.approx(naive.mean(begin, end), abs=1e-9)
        assert mean.deviation == pytest.approx(naive.deviation(begin, end), abs=1e-5)
    assert found.samples == len(measured)
    assert found.greatest == max((speed for _, speed, _ in measured), default=None)
    taken = [gust for gust, _ in naive.gusts(begin, end)]
    assert (found.gust is None) == (found.lull is None) == (not taken)
    if found.gust is not None and found.lull is not None:
        assert found.gust.speed == pytest.approx(max(taken))
        assert found.lull.speed == pytest.approx(min(taken))
        for peak in (found.gust, found.lull):
            assert any(at == peak.at and gust == pytest.approx(peak.speed) for gust, at in naive.gusts(begin, end))
