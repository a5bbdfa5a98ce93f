"""Counts and figures of one device."""

from __future__ import annotations

from dataclasses import replace

from lfs10d.reading import Fault, FaultCode
from lfs10d.telemetry.counters import DeviceCounters, LineCounters
from tests.support.counted import BUSY, START, TIMEOUT, exchange, reading

LOST = Fault(FaultCode.PORT_LOST, "")


def test_a_device_never_polled_has_nulls() -> None:
    assert DeviceCounters(None).payload(7) == {
        "v": 1,
        "ts": 7,
        "polls": 0,
        "good": 0,
        "partial": 0,
        "errors": {},
        "rtt_ms": {"p50": None, "p95": None},
        "response_timeout_ms": None,
        "request_gap_ms": 0.0,
        "last_good_ts": None,
    }


def test_a_fixed_time_out_is_known_before_the_first_poll() -> None:
    assert DeviceCounters(0.25).payload(7)["response_timeout_ms"] == 250.0


def test_a_configured_rest_is_known_before_the_first_poll_and_a_learned_one_after_it() -> None:
    counters = DeviceCounters(None, 0.1)
    assert counters.payload(7)["request_gap_ms"] == 100.0
    counters.polled(replace(reading(1.0), request_gap=0.4), 7)
    assert counters.payload(7)["request_gap_ms"] == 400.0


def test_a_device_s_polls_values_errors_and_times_are_told() -> None:
    counters = DeviceCounters(None)
    for number in range(100):
        counters.polled(reading(START + number, rtt=0.0101 + number / 1000), 5000 + number)
    counters.polled(reading(START + 100, TIMEOUT, overruns=2), 6000)
    counters.polled(reading(START + 101, BUSY), 6001)
    assert counters.payload(7) == {
        "v": 1,
        "ts": 7,
        "polls": 102,
        "good": 100,
        "partial": 0,
        "errors": {"overrun": 2, "timeout": 1},
        "rtt_ms": {"p50": 59.1, "p95": 104.1},
        "response_timeout_ms": 200.0,
        "request_gap_ms": 0.0,
        "last_good_ts": 5099,
    }


def test_a_good_reading_without_a_time_of_answer_spoils_no_percentile() -> None:
    counters = DeviceCounters(None)
    counters.polled(reading(START, rtt=None), 1)
    assert (counters.payload(7)["good"], counters.payload(7)["rtt_ms"]) == (1, {"p50": None, "p95": None})


def test_a_partial_reading_counts_as_good_and_is_no_error() -> None:
    counters = DeviceCounters(None)
    counters.polled(reading(START), 1)
    counters.polled(replace(reading(START + 1), value_errors={"rain": FaultCode.EXCEPTION}), 2)
    payload = counters.payload(7)
    assert (payload["polls"], payload["good"], payload["partial"], payload["errors"]) == (2, 2, 1, {})
    assert payload["last_good_ts"] == 2


def test_the_time_between_two_polls_is_told() -> None:
    counters = DeviceCounters(None)
    assert counters.polled(reading(START), 1) is None
    assert counters.polled(reading(START + 0.5, TIMEOUT), 2) == 0.5


def test_probes_are_polls_but_stand_apart() -> None:
    counters = DeviceCounters(None)
    counters.polled(reading(START), 1)
    assert counters.polled(reading(START + 15, TIMEOUT, probe=True), 2) is None
    assert counters.polled(reading(START + 30), 3) is None
    assert counters.payload(7)["polls"] == 3


def test_a_lost_port_is_an_error_but_no_poll() -> None:
    counters = DeviceCounters(None)
    counters.polled(reading(START), 1)
    assert counters.polled(reading(START + 1, LOST), 2) is None
    assert counters.polled(reading(START + 9), 3) is None
    assert (counters.payload(7)["polls"], counters.payload(7)["errors"]) == (2, {"port_lost": 1})


def test_of_answer_times_only_the_last_hundred_are_kept() -> None:
    counters = DeviceCounters(None)
    for rtt in (0.5, 0.25):
        for n in range(100):
            counters.polled(reading(START + n, rtt=rtt), 7)
    assert counters.payload(7)["rtt_ms"] == {"p50": 250.0, "p95": 250.0}


def test_what_happens_twice_counts_twice() -> None:
    line, device = LineCounters(START), DeviceCounters(None)
    for at in (START, START + 1):
        line.exchanged(exchange(at, late=2))
        line.overran(3)
        line.lost(FaultCode.PORT_LOST)
        device.polled(reading(at, TIMEOUT, overruns=4), 7)
    assert line.errors == {"late": 4, "overrun": 6, "port_lost": 2}
    assert device.errors == {"timeout": 2, "overrun": 8}
