"""Values that hold, gaps between them, and what is kept of them."""

from __future__ import annotations

from lfs10d.telemetry.wind.series import BLOCK, GAP, REACH, Sums
from lfs10d.telemetry.wind.speed import SpeedSeries

T = 1_000_000_000


def bits(of: SpeedSeries) -> int:
    return of._values.itemsize * 8


def test_blocks_are_summed_up_as_they_are_complete_though_a_gap_completes_one() -> None:
    filled = SpeedSeries()
    for place in range(BLOCK):
        filled.add(T + 250 * place, 5.0, 2000)
    assert filled._closed == 0
    filled.add(T + 250 * BLOCK + 9000, 5.0, 2000)  # first the gap, then the value
    assert filled._closed == 1
    assert filled.mean(T, T + 10**6).covered == 250 * (BLOCK - 1) + 2000 + 2000


def test_the_sums_of_a_span_are_those_of_its_parts() -> None:
    whole, part = Sums(5000, 7.0, 9.0), Sums(2000, 3.0, 4.0)
    assert whole.less(part) == Sums(3000, 4.0, 5.0)
    assert whole.less(part).plus(part) == whole


def test_a_window_between_blocks_in_one_block_and_over_several_has_all_of_its_entries() -> None:
    filled = SpeedSeries()
    for place in range(10 * BLOCK):
        filled.add(T + 1000 * place, float(place), 2000)
    for first, last in ((0, 5), (BLOCK, 2 * BLOCK), (BLOCK - 1, 5 * BLOCK + 1), (3, 300), (300, 320), (0, 320)):
        begin, end = T + 1000 * first, T + 1000 * last
        assert filled.extremes(begin, end).samples == last - first
        assert filled.mean(begin, end).covered == end - begin
        assert filled.mean(begin, end).mean == (first + last - 1) / 2


def test_what_is_older_than_all_windows_is_dropped_and_a_long_silence_begins_anew() -> None:
    filled = SpeedSeries()
    for place in range(2000):
        filled.add(T + 1000 * place, 5.0, 2000)
    assert REACH // 1000 <= len(filled._times) <= REACH // 1000 + 5 * BLOCK
    filled.add(T + 10**7, 7.0, 2000)
    assert (len(filled._times), filled._closed) == (1, 0)
    filled.end(T + 10**7 + 500)
    assert filled.held_until == T + 10**7 + 500


def test_from_the_first_value_that_is_no_whole_hundred_thousandth_on_values_are_kept_as_they_are() -> None:
    filled = SpeedSeries()
    for place in range(3 * BLOCK):
        filled.add(T + 250 * place, 5.25, 2000)
    filled.add(T + 250 * 3 * BLOCK + 9000, 5.12345, 2000)  # behind a gap
    assert bits(filled) == 32
    filled.add(T + 250 * 3 * BLOCK + 9250, 5.123456, 2000)
    assert bits(filled) == 64
    assert list(filled._values)[-4:] == [5.25, GAP, 5.12345, 5.123456]
    filled.add(T + 250 * 3 * BLOCK + 9500, 5.25, 2000)
    assert filled.mean(T, T + 20_000).mean == 5.25
    assert filled.extremes(T, T + 10**6).greatest == 5.25


def test_a_window_within_one_block_and_one_that_ends_before_all_values_have_their_sums() -> None:
    filled = SpeedSeries()
    for place in range(BLOCK + 5):
        filled.add(T + 1000 * place, float(place), 2000)
    assert filled.mean(T + 2500, T + 4500).covered == 2000
    assert filled.mean(T + 2500, T + 4500).mean == 3.0
    assert filled.mean(T - 5000, T - 1000).covered == 0
    assert filled.mean(T - 5000, T + 1000).covered == 1000
    assert SpeedSeries().mean(T, T + 1000).covered == 0


def test_a_value_dated_before_the_newest_counts_as_new_and_a_gap_is_no_value() -> None:
    filled = SpeedSeries()
    filled.add(T, 4.0, 2000)
    filled.add(T + 5000, 6.0, 2000)
    filled.add(T + 4000, 8.0, 2000)
    assert filled.newest == T + 5000
    assert filled.mean(T, T + 10_000).covered == 4000
    assert filled.mean(T + 2000, T + 10_000).mean == 8.0


def test_times_go_on_beyond_24_days_in_32_bits() -> None:
    filled = SpeedSeries()
    hour = 3_600_000
    for place in range(700):
        filled.add(T + hour * place, 5.0, 2 * hour)
    end = T + hour * 700
    assert end - filled._origin < 2**31
    assert filled.mean(end - hour, end).covered == hour
