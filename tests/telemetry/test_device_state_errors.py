"""Errors of a device: raised after failures, cleared by a value, taken back with the port."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lfs10d.reading import AnsweredTwice, Fault, FaultCode, Reading
from tests.support.device_states import REFUSED, TIMEOUT, Watched, fields, instant, leaves

BUSY = Fault(FaultCode.EXCEPTION, "busy", exception_code=6, busy=True)
LOST = Fault(FaultCode.PORT_LOST, "absent")


def test_an_error_rises_after_as_many_failures_as_make_it_offline_and_clears_with_one_value() -> None:
    watched = Watched()
    watched.poll(0, 1.0)
    assert watched.poll(1, TIMEOUT, online=True) == ["telemetry", "state"]
    assert watched.poll(2, TIMEOUT) == ["telemetry", "state", "availability", "error"]
    assert fields(watched.shown["error"], "active", "code", "count") == (True, "timeout", 2)
    assert watched.poll(3, 1.0) == ["telemetry", "availability", "state", "error"]
    assert fields(watched.shown["error"], "active", "last_code") == (False, "timeout")


def test_a_refusal_proves_the_device_alive() -> None:
    watched = Watched()
    assert watched.poll(0, REFUSED, online=True) == ["telemetry", "availability", "state"]
    assert watched.shown["availability"] == "online"
    assert fields(watched.shown["state"], "error", "wind_speed") == ("exception", None)


def test_a_busy_device_is_a_bad_sample_but_no_error() -> None:
    watched = Watched()
    for second in range(5):
        assert "error" not in watched.poll(second, BUSY, online=True)
    assert fields(watched.shown["state"], "error", "quality") == ("exception", "bad")
    assert fields(watched.shown["error"], "active") == (False,)


def test_a_busy_answer_neither_ends_nor_lengthens_a_run_of_failures() -> None:
    watched = Watched()
    watched.poll(0, TIMEOUT)
    watched.poll(1, BUSY, online=True)
    assert "error" in watched.poll(2, TIMEOUT)


def test_a_lost_port_takes_the_device_s_own_error_back() -> None:
    watched = Watched()
    watched.poll(0, TIMEOUT)
    watched.poll(1, TIMEOUT)
    assert watched.poll(2, LOST) == ["telemetry", "state", "error"]
    assert fields(watched.shown["state"], "error") == ("port_lost",)
    assert fields(watched.shown["error"], "active", "last_code") == (False, "timeout")
    assert "error" not in watched.poll(3, TIMEOUT)
    assert "error" in watched.poll(4, TIMEOUT)


def test_while_masked_failures_are_not_held_against_the_device() -> None:
    watched = Watched()
    assert all("error" not in watched.poll(second, TIMEOUT, masked=True) for second in range(5))


def test_a_mask_is_published_only_where_there_was_an_error() -> None:
    watched = Watched()
    assert watched.device.mask(instant(0)) == []
    watched.poll(0, TIMEOUT)
    watched.poll(1, TIMEOUT)
    assert leaves(watched.device.mask(instant(2))) == ["error"]


def test_what_is_told_late_has_the_time_at_which_it_happened() -> None:
    device = Watched().device
    reading = Reading("a", 10.0, {"wind_speed": 1.0}, None, 0.5, online=True, response_timeout=0.2)
    (telemetry, *_) = device.on_reading(reading, instant(12.0), masked=False)[0]
    assert fields(telemetry.payload, "ts", "rtt_ms") == (1_795_298_010_000, 500.0)
    fault = replace(reading, values=None, fault=TIMEOUT, rtt=None, online=False)
    device.on_reading(replace(fault, at=13.0), instant(15.0), masked=False)[0]
    risen = device.on_reading(replace(fault, at=14.0), instant(16.0), masked=False)[0][-1]
    assert fields(risen.payload, "since", "last") == (1_795_298_013_000, 1_795_298_014_000)
    cleared = device.on_reading(replace(reading, at=17.0), instant(19.0), masked=False)[0][-1]
    assert fields(cleared.payload, "active", "cleared") == (False, 1_795_298_017_000)


@pytest.mark.parametrize("masked", [False, True])
def test_an_error_taken_back_was_cleared_when_that_was_found(masked: bool) -> None:  # noqa: FBT001  # a case
    watched = Watched()
    watched.poll(1.0, TIMEOUT)
    watched.poll(2.0, TIMEOUT)
    published = watched.publish(3.0, LOST, masked=True) if masked else watched.device.mask(instant(3.0))
    assert fields(published[-1].payload, "cleared") == (1_795_298_003_000,)


def test_an_id_answered_twice_is_an_event_and_an_error_beside_good_samples() -> None:
    watched = Watched()
    watched.poll(1.0, 12.3)
    twice = AnsweredTwice(1.5, "a", 3, Fault(FaultCode.DUPLICATE_ID, "slave 3 is answered for twice"))
    error, told = watched.device.on_answered_twice(twice, instant(1.5))
    assert error.topic == "device/a/error"
    assert fields(error.payload, "active", "code") == (True, "duplicate_id")
    assert fields(told.payload, "type", "device", "slave") == ("duplicate_id", "a", 3)
    assert watched.device.on_answered_twice(twice, instant(1.6)) == []
    watched.poll(3.0, 12.4)
    assert fields(watched.shown["state"], "quality", "error") == ("good", None)
    assert fields(watched.shown["error"], "code") == ("duplicate_id",)
    over = AnsweredTwice(9.0, "a", 3, None)
    (cleared,) = watched.device.on_answered_twice(over, instant(9.0))
    assert fields(cleared.payload, "active", "last_code") == (False, "duplicate_id")
    watched.device.on_answered_twice(twice, instant(10.0))
    assert leaves(watched.device.mask(instant(11.0))) == ["error"]
    assert fields(watched.shown["error"], "active") == (False,)
