"""Counts since boot and figures of the last half minute."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.reading import Fault, FaultCode, Purpose, UartCounters
from lfs10d.telemetry.counters import DeviceCounters, LineCounters, percentile, scaled
from lfs10d.telemetry.publication import BacklogStats
from tests.support.counted import BUSY, START, TIMEOUT, exchange, reading


def figures(counters: LineCounters, now: float = START + 30) -> Mapping[str, object]:
    return counters.payload(now, ts=7, gap_required=0.0036458, backlog=BacklogStats(5, 3, 2))


def gaps(counters: LineCounters) -> dict[str, float | None]:
    return cast("dict[str, float | None]", figures(counters)["gap_us"])


@given(st.lists(st.floats(0, 1), min_size=1, max_size=50), st.integers(1, 100))
def test_a_percentile_is_the_smallest_value_that_enough_do_not_exceed(values: list[float], percent: int) -> None:
    found = percentile(values, percent)
    assert found is not None
    enough = len(values) * percent / 100
    assert sum(value <= found for value in values) >= enough
    assert sum(value < found for value in values) < enough


def test_of_nothing_there_is_no_percentile() -> None:
    assert percentile([], 50) is None
    assert scaled(None, 1e3, 1) is None


def test_before_anything_happened_all_that_is_unknown_is_null() -> None:
    assert LineCounters(START).payload(START, ts=7, gap_required=0.0036458, backlog=BacklogStats()) == {
        "v": 1,
        "ts": 7,
        "load_pct": None,
        "polls_per_s": None,
        "cycle_s": None,
        "gap_required_us": 3645.8,
        "gap_us": {"min": None, "p50": None, "p99": None},
        "exchanges": 0,
        "errors": {},
        "unsolicited_bytes": 0,
        "uart": None,
        "store": {"depth": 0, "oldest_ts": None, "dropped": 0},
    }


def test_an_idle_line_is_known_to_be_idle() -> None:
    payload = figures(LineCounters(START))
    assert (payload["load_pct"], payload["polls_per_s"], payload["cycle_s"]) == (0.0, 0.0, None)


def test_the_load_is_the_share_of_the_time_the_line_was_given_away() -> None:
    counters = LineCounters(START)
    for number in range(600):
        counters.exchanged(exchange(START + 0.05 * (number + 1), took=0.02))
    payload = figures(counters)
    assert payload["load_pct"] == pytest.approx(40, abs=1)
    assert payload["exchanges"] == 600


def test_the_load_never_exceeds_the_line() -> None:
    counters = LineCounters(START)
    counters.exchanged(exchange(START + 0.1, took=5.0))
    assert figures(counters, START + 1.5)["load_pct"] == 100.0


def test_rates_are_of_the_last_half_minute_alone() -> None:
    counters = LineCounters(START)
    for number in range(1000):
        counters.polled(reading(START + 0.1 * number), 0.1)
    assert figures(counters, START + 100)["polls_per_s"] == pytest.approx(10, abs=0.1)
    assert figures(counters, START + 115)["polls_per_s"] == pytest.approx(5, abs=0.2)
    assert figures(counters, START + 200)["polls_per_s"] == 0.0


def test_shortly_after_the_start_rates_are_of_the_time_since() -> None:
    counters = LineCounters(START)
    for number in range(20):
        counters.polled(reading(START + 0.1 * number), None)
    assert figures(counters, START + 2)["polls_per_s"] == 10.0


@pytest.mark.parametrize("since", [0.0, 5e-324, 0.9])
def test_within_the_first_second_no_rate_is_known(since: float) -> None:
    counters = LineCounters(0.0)
    counters.exchanged(exchange(0.0))
    counters.polled(reading(0.0), None)
    payload = figures(counters, since)
    assert (payload["load_pct"], payload["polls_per_s"]) == (None, None)


def test_the_cycle_is_the_longest_time_between_two_polls_of_one_device() -> None:
    counters = LineCounters(START)
    for apart in (0.3, 0.9, None, 0.5):
        counters.polled(reading(START + 1), apart)
    assert figures(counters)["cycle_s"] == 0.9
    assert figures(counters, START + 60)["cycle_s"] is None


def test_an_event_that_comes_in_late_joins_the_newest_second() -> None:
    counters = LineCounters(START)
    counters.polled(reading(START + 5), None)
    counters.polled(reading(START + 3.9), None)
    assert figures(counters, START + 10)["polls_per_s"] == 0.2


def test_gaps_are_told_by_their_least_median_and_99th_percentile() -> None:
    counters = LineCounters(START)
    for number in range(100):
        counters.exchanged(exchange(START, gap=0.004 + number * 1e-5))
    assert gaps(counters) == {"min": 4000.0, "p50": 4490.0, "p99": 4980.0}


def test_the_least_gap_is_since_boot_and_the_others_of_the_last_thousand() -> None:
    counters = LineCounters(START)
    counters.exchanged(exchange(START, gap=0.0037))
    for _ in range(1000):
        counters.exchanged(exchange(START, gap=0.005))
    assert gaps(counters) == {"min": 3700.0, "p50": 5000.0, "p99": 5000.0}


@pytest.mark.parametrize("purpose", [Purpose.SCAN, Purpose.CHANGE])
def test_gaps_at_other_rates_are_left_out(purpose: Purpose) -> None:
    counters = LineCounters(START)
    counters.exchanged(exchange(START, gap=0.001, purpose=purpose))
    counters.exchanged(exchange(START, gap=None))
    assert gaps(counters) == {"min": None, "p50": None, "p99": None}


def test_a_line_at_another_rate_has_no_gaps_yet() -> None:
    counters = LineCounters(START)
    counters.exchanged(exchange(START, gap=0.0019))
    counters.retimed()
    counters.exchanged(exchange(START, gap=0.0040))
    assert gaps(counters)["min"] == 4000.0


def test_errors_count_every_attempt_of_a_poll_but_no_busy_device() -> None:
    counters = LineCounters(START)
    counters.polled(reading(START, failed=(FaultCode.CRC,)), None)
    counters.polled(reading(START, TIMEOUT, failed=(FaultCode.CRC,)), None)
    counters.polled(reading(START, BUSY), None)
    assert figures(counters)["errors"] == {"crc": 2, "timeout": 1}


def test_late_answers_are_counted_one_by_one_and_not_again_with_their_poll() -> None:
    counters = LineCounters(START)
    counters.exchanged(exchange(START, late=2))
    counters.polled(reading(START, Fault(FaultCode.LATE, ""), failed=(FaultCode.LATE,)), None)
    assert figures(counters)["errors"] == {"late": 2}


def test_losses_of_the_port_and_missed_points_of_the_grid_are_counted() -> None:
    counters = LineCounters(START)
    counters.lost(FaultCode.PORT_BUSY)
    counters.overran(3)
    assert figures(counters)["errors"] == {"port_busy": 1, "overrun": 3}


def test_unsolicited_bytes_uart_and_store_are_told() -> None:
    counters = LineCounters(START)
    counters.exchanged(exchange(START, unsolicited=4))
    counters.exchanged(exchange(START, unsolicited=1))
    counters.uart = UartCounters(framing=1, parity=2, overrun=3, breaks=4)
    payload = figures(counters)
    assert payload["unsolicited_bytes"] == 5
    assert payload["uart"] == {"framing": 1, "parity": 2, "overrun": 3, "break": 4}
    assert payload["store"] == {"depth": 5, "oldest_ts": 3, "dropped": 2}


def test_a_percentile_is_not_one_too_small_where_the_share_is_just_above_a_whole_number() -> None:
    assert percentile([float(n) for n in range(26)], 77) == 20.0


def test_figures_are_told_to_a_tenth_of_their_unit() -> None:
    counters = LineCounters(START)
    odd = 0.50000014
    counters.exchanged(exchange(START + 1.0, gap=odd))
    told = counters.payload(START + 30, ts=7, gap_required=odd, backlog=BacklogStats())
    assert told["gap_required_us"] == 500_000.1
    assert told["gap_us"] == {"min": 500_000.1, "p50": 500_000.1, "p99": 500_000.1}
    device = DeviceCounters(0.50014)
    device.polled(reading(START, rtt=0.50014), 7)
    device.response_timeout = 0.50014
    told = device.payload(7)
    assert told["rtt_ms"] == {"p50": 500.1, "p95": 500.1}
    assert told["response_timeout_ms"] == 500.1


def test_rates_are_told_in_tenths_of_a_percent_hundredths_of_a_poll_and_milliseconds() -> None:
    counters = LineCounters(START)
    counters.exchanged(exchange(START + 1.0, took=0.37037))
    counters.polled(reading(START + 1.0), 1.23456)
    rates = counters.rates(START + 3.0)
    assert (rates.load_pct, rates.polls_per_s, rates.cycle_s) == (12.3, 0.33, 1.235)


def test_a_load_of_half_the_time_is_half() -> None:
    counters = LineCounters(START)
    for second in range(30):
        counters.exchanged(exchange(START + second + 0.6, took=0.5))
    assert counters.rates(START + 30).load_pct == pytest.approx(50.0, abs=0.1)


def test_within_the_first_second_the_cycle_is_known_and_after_it_the_rates() -> None:
    counters = LineCounters(START)
    counters.polled(reading(START + 0.5), 0.25)
    assert counters.rates(START + 0.9)._asdict() == {"load_pct": None, "polls_per_s": None, "cycle_s": 0.25}
    assert counters.rates(START + 1.0).polls_per_s == 1.0


def test_the_events_of_one_second_are_kept_as_one() -> None:
    counters = LineCounters(START)
    for n in range(1000):
        counters.exchanged(exchange(START + n / 1001, took=0.0))
    assert len(counters._seconds) == 1


def test_of_gaps_only_the_last_thousand_are_kept() -> None:
    counters = LineCounters(START)
    for gap in (0.5, 0.25):
        for n in range(1000):
            counters.exchanged(exchange(START + n, gap=gap))
    assert gaps(counters) == {"min": 250_000.0, "p50": 250_000.0, "p99": 250_000.0}
