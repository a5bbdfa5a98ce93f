"""Means, deviations and sectors of directions, against closed forms and a naive reference."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.telemetry.wind.direction import SEEN_BYTES, DirectionSeries, Spread, compass, spread
from lfs10d.telemetry.wind.series import BLOCK
from tests.support.naive_wind import Good, Naive, sector, yamartino

T = 1_000_000_000


def series(directions: list[float], *, step: int = 1000, hold: int = 2000) -> DirectionSeries:
    filled = DirectionSeries()
    for place, direction in enumerate(directions):
        filled.add(T + step * place, direction, hold)
    return filled


def test_north_is_360_and_so_is_what_is_rounded_to_it() -> None:
    assert [compass(each) for each in (0.0, 0.4, 0.6, 359.4, 359.6, 360.0, -10.0)] == [360, 360, 1, 359, 360, 360, 350]


def test_directions_about_north_have_their_mean_there() -> None:
    vector = series([350.0, 10.0] * 60).vector(T, T + 120_000)
    assert (vector.covered, vector.direction) == (120_000, 360)
    assert vector.deviation == pytest.approx(yamartino(math.cos(math.radians(10)), 0.0))


def test_each_direction_weighs_as_long_as_it_holds() -> None:
    filled = DirectionSeries()
    filled.add(T, 0.0, 5000)
    filled.add(T + 3000, 90.0, 1000)
    vector = filled.vector(T, T + 10_000)
    assert (vector.covered, vector.direction) == (4000, compass(math.degrees(math.atan2(1, 3))))


def test_directions_that_cancel_out_have_a_deviation_and_no_mean() -> None:
    vector = series([90.0, 270.0] * 30).vector(T, T + 60_000)
    assert vector.direction is None
    assert vector.deviation == pytest.approx(yamartino(0.0, 0.0))


def test_nothing_has_neither() -> None:
    empty = DirectionSeries()
    vector = empty.vector(T, T + 60_000)
    assert (vector.direction, vector.deviation) == (None, None)
    assert empty.samples(T, T + 60_000) == 0
    assert empty.spread(T, T + 60_000) is None


def test_a_steady_vane_has_no_deviation() -> None:
    assert series([217.3] * 100).vector(T, T + 100_000).deviation == pytest.approx(0.0, abs=1e-5)


def test_two_spans_amount_to_their_whole() -> None:
    filled = series([place * 7 % 50 for place in range(500)])
    parts = filled.vector(T, T + 123_456)
    parts.add(filled.vector(T + 123_456, T + 500_000))
    whole = filled.vector(T, T + 500_000)
    assert parts.covered == whole.covered
    assert [parts.north, parts.east] == pytest.approx([whole.north, whole.east])


@pytest.mark.parametrize(
    ("directions", "expected"),
    [
        ([217], Spread(0, 217, 217)),
        ([350, 10], Spread(20, 350, 10)),
        ([10, 350, 300, 359, 360, 1], Spread(70, 300, 10)),
        ([360], Spread(0, 360, 360)),
        ([360, 60], Spread(60, 360, 60)),
        ([1, 360], Spread(1, 360, 1)),
        ([90, 180, 170], Spread(90, 90, 180)),
        (list(range(1, 361)), Spread(359, 2, 1)),
    ],
)
def test_the_least_sector_that_holds_all_is_found_through_north_too(directions: list[int], expected: Spread) -> None:
    assert series([float(each) for each in directions]).spread(T, T + 10**6) == expected


def test_of_nothing_there_is_no_sector() -> None:
    assert spread(0) is None


def test_what_is_forgotten_counts_no_longer() -> None:
    filled = series([90.0] * 10 + [180.0] * 2000)
    assert len(filled._seen) // SEEN_BYTES * BLOCK < 1000
    assert filled.spread(T + 1_400_000, T + 2_010_000) == Spread(0, 180, 180)


def test_of_a_window_over_several_blocks_the_values_at_its_ends_count_one_by_one() -> None:
    filled = series([float(place) for place in range(BLOCK)] + [100.0] * 3 * BLOCK + [200.0] * 10)
    assert filled.samples(T, T + 10**6) == 4 * BLOCK + 10
    for first in range(BLOCK - 2, BLOCK + 2):
        begin, end = T + 1000 * first, T + 10**6
        assert filled.samples(begin, end) == 4 * BLOCK + 10 - first
        least = first if first < BLOCK else 100
        assert filled.spread(begin, end) == Spread(200 - least, least, 200)
    assert filled.spread(T + 1000 * (BLOCK - 1), T + 1000 * (4 * BLOCK + 5)) == Spread(201 - BLOCK, BLOCK - 1, 200)
    filled.add(T + 500_000, 200.0, 2000)  # behind a gap
    assert filled.samples(T + 30_000, T + 10**6) == 4 * BLOCK + 11 - 30


def test_after_a_long_silence_a_series_begins_anew() -> None:
    filled = series([90.0] * 100)
    filled.add(T + 10**7, 180.0, 2000)
    assert filled.samples(T, T + 10**8) == 1


steps = st.one_of(st.just(250), st.integers(1, 9000))


@given(
    st.lists(st.tuples(steps, st.floats(0, 360)), min_size=1, max_size=120),
    st.tuples(st.integers(-5000, 300_000), st.integers(1, 700_000)),
)
def test_irregular_series_are_counted_as_a_naive_reference_counts_them(
    drawn: list[tuple[int, float]], window: tuple[int, int]
) -> None:
    at, filled = T, DirectionSeries()
    values: list[Good] = []
    for step, direction in drawn:
        at += step
        values.append((at, direction, 2000))
        filled.add(at, direction, 2000)
    naive, begin, end = Naive(values), T + window[0], T + window[0] + window[1]
    vector, measured = filled.vector(begin, end), naive.measured(begin, end)
    assert vector.covered == naive.covered(begin, end)
    if vector.covered:
        north, east = naive.vector(begin, end)
        mean = [vector.north / vector.covered, vector.east / vector.covered]
        assert mean == pytest.approx([north, east], abs=1e-9)
        assert vector.deviation == pytest.approx(yamartino(north, east), abs=1e-4)
    assert filled.samples(begin, end) == len(measured)
    found = filled.spread(begin, end)
    assert (found is None) == (not measured)
    if found is not None:
        assert found.degrees == sector([compass(direction) for _, direction, _ in measured])
