"""Rise and clear of errors."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.reading import PORT_CODES, Fault, FaultCode, LineFaultCode
from lfs10d.telemetry.alarms import PRECEDENCE, DeviceAlarm, LineAlarm

TIMEOUT = Fault(FaultCode.TIMEOUT, "no answer in 200 ms")
CRC = Fault(FaultCode.CRC, "check wrong", heard=bytes(range(40)))
REFUSED = Fault(FaultCode.EXCEPTION, "illegal register address", exception_code=2, heard=b"\x01\x83\x02\xc0\xf1")
LOST: tuple[LineFaultCode, str] = FaultCode.PORT_LOST, "absent"
BUSY: tuple[LineFaultCode, str] = FaultCode.PORT_BUSY, "locked by minicom"
WRONG: tuple[LineFaultCode, str] = FaultCode.WRONG_RATE, "3 of 3 at 19200 baud"
FULL: tuple[LineFaultCode, str] = FaultCode.STORAGE_FULL, "disk full"
TAKEN: tuple[LineFaultCode, str] = FaultCode.DUPLICATE_CLIENT, "another client has our id"

FINE = {"v": 1, "active": False, "code": None, "last_code": None, "cleared": None}


def fail(alarm: DeviceAlarm, *faults: Fault, since: int = 100) -> list[bool]:
    """Fail once per fault, 10 ms apart; return when it is to be published."""
    return [alarm.failed(fault, since + 10 * number) for number, fault in enumerate(faults)]


def test_a_device_that_never_failed_is_fine() -> None:
    assert DeviceAlarm(3).payload() == FINE


def test_an_error_rises_with_the_third_failure_in_a_row_and_is_published_once() -> None:
    alarm = DeviceAlarm(3)
    assert fail(alarm, TIMEOUT, TIMEOUT, TIMEOUT, TIMEOUT) == [False, False, True, False]
    assert alarm.payload() == {
        "v": 1,
        "active": True,
        "code": "timeout",
        "also": [],
        "message": "no answer in 200 ms",
        "exception_code": None,
        "heard": "",
        "since": 100,
        "last": 130,
        "count": 4,
    }


def test_before_it_rises_nothing_is_shown() -> None:
    alarm = DeviceAlarm(3)
    fail(alarm, TIMEOUT, TIMEOUT)
    assert alarm.payload() == FINE
    assert not alarm.active


def test_a_good_poll_in_between_starts_the_count_again() -> None:
    alarm = DeviceAlarm(2)
    assert fail(alarm, TIMEOUT) == [False]
    assert alarm.ended(110) is False
    assert fail(alarm, TIMEOUT) == [False]


def test_failures_of_different_kinds_count_together_and_the_newest_is_shown() -> None:
    alarm = DeviceAlarm(3)
    assert fail(alarm, TIMEOUT, CRC, REFUSED) == [False, False, True]
    payload = alarm.payload()
    assert (payload["code"], payload["also"]) == ("exception", ["timeout", "crc"])
    assert (payload["exception_code"], payload["heard"]) == (2, "01 83 02 C0 F1")


def test_a_change_of_code_is_published_and_the_other_code_remembered() -> None:
    alarm = DeviceAlarm(1)
    assert fail(alarm, TIMEOUT, TIMEOUT, CRC, CRC, TIMEOUT) == [True, False, True, False, True]
    assert (alarm.payload()["code"], alarm.payload()["also"]) == ("timeout", ["crc"])


def test_only_the_last_32_bytes_heard_are_shown() -> None:
    alarm = DeviceAlarm(1)
    fail(alarm, CRC)
    assert alarm.payload()["heard"] == bytes(range(8, 40)).hex(" ").upper()


def test_one_good_poll_clears_and_says_what_it_was() -> None:
    alarm = DeviceAlarm(1)
    fail(alarm, CRC, TIMEOUT)
    assert alarm.ended(500) is True
    assert alarm.payload() == {**FINE, "last_code": "timeout", "cleared": 500}
    assert alarm.ended(600) is False
    assert alarm.payload()["cleared"] == 500


def test_a_conflict_of_configuration_rises_at_once() -> None:
    alarm = DeviceAlarm(3)
    assert fail(alarm, Fault(FaultCode.CONFIG_CONFLICT, "slave 3 is taken")) == [True]


def test_the_threshold_may_change_while_the_count_runs() -> None:
    alarm = DeviceAlarm(5)
    fail(alarm, TIMEOUT, TIMEOUT)
    alarm.rise_after = 2
    assert fail(alarm, TIMEOUT) == [True]


@given(st.integers(1, 5), st.lists(st.sampled_from([TIMEOUT, CRC, None]), max_size=30))
def test_an_error_is_active_exactly_after_so_many_failures_in_a_row(rise_after: int, polls: list[Fault | None]) -> None:
    """Against a naive oracle; and whoever heard only what was published knows code and activity."""
    alarm = DeviceAlarm(rise_after)
    known = alarm.payload()
    streak = 0
    for number, fault in enumerate(polls):
        streak = 0 if fault is None else streak + 1
        changed = alarm.ended(number) if fault is None else alarm.failed(fault, number)
        if changed:
            known = alarm.payload()
        now = alarm.payload()
        assert now["active"] is (streak >= rise_after)
        assert (known["active"], known["code"]) == (now["active"], now["code"])


def test_an_error_of_the_line_rises_at_once() -> None:
    alarm = LineAlarm()
    assert alarm.payload() == FINE
    assert alarm.failed(*LOST, 100) is True
    assert (alarm.payload()["code"], alarm.payload()["message"], alarm.payload()["also"]) == (
        "port_lost",
        "absent",
        [],
    )


def test_the_same_error_of_the_line_again_is_counted_but_not_published() -> None:
    alarm = LineAlarm()
    alarm.failed(*LOST, 100)
    assert alarm.failed(*LOST, 300) is False
    payload = alarm.payload()
    assert (payload["since"], payload["last"], payload["count"]) == (100, 300, 2)


def test_another_reason_for_the_same_loss_is_published() -> None:
    alarm = LineAlarm()
    alarm.failed(*LOST, 100)
    assert alarm.failed(FaultCode.PORT_LOST, "permission denied", 200) is True
    assert alarm.payload()["message"] == "permission denied"


def test_the_port_has_one_fault_at_a_time() -> None:
    alarm = LineAlarm()
    alarm.failed(*LOST, 100)
    assert alarm.failed(*BUSY, 200) is True
    assert (alarm.payload()["code"], alarm.payload()["also"]) == ("port_busy", [])


@pytest.mark.parametrize("order", [(FULL, TAKEN, WRONG, LOST), (LOST, TAKEN, FULL, WRONG)])
def test_of_several_errors_of_the_line_the_port_s_is_shown(order: tuple[tuple[LineFaultCode, str], ...]) -> None:
    alarm = LineAlarm()
    for fault in order:
        alarm.failed(*fault, 100)
    payload = alarm.payload()
    assert (payload["code"], payload["also"]) == ("port_lost", ["wrong_rate", "duplicate_client", "storage_full"])


def test_when_the_foremost_error_ends_the_next_is_shown() -> None:
    alarm = LineAlarm()
    alarm.failed(*FULL, 100)
    alarm.failed(*LOST, 200)
    assert alarm.ended(PORT_CODES, 300) is True
    assert alarm.payload()["code"] == "storage_full"
    assert alarm.ended(frozenset({FaultCode.STORAGE_FULL}), 400) is True
    assert alarm.payload() == {**FINE, "last_code": "storage_full", "cleared": 400}


def test_an_error_that_hides_behind_another_ends_unseen() -> None:
    alarm = LineAlarm()
    alarm.failed(*FULL, 100)
    alarm.failed(*LOST, 200)
    assert alarm.ended(frozenset({FaultCode.STORAGE_FULL}), 300) is False
    assert (alarm.payload()["code"], alarm.payload()["also"]) == ("port_lost", [])


def test_what_was_never_raised_cannot_end() -> None:
    alarm = LineAlarm()
    assert alarm.ended(PORT_CODES, 100) is False
    assert alarm.payload() == FINE


def test_an_error_that_rises_with_its_first_failure_has_happened_once_and_just_now() -> None:
    alarm = DeviceAlarm(1)
    alarm.failed(TIMEOUT, 100)
    payload = alarm.payload()
    assert (payload["since"], payload["last"], payload["count"]) == (100, 100, 1)
    line = LineAlarm()
    line.failed(*LOST, 100)
    payload = line.payload()
    assert (payload["since"], payload["last"], payload["count"]) == (100, 100, 1)


def test_an_alarm_is_active_from_its_rise_to_its_end() -> None:
    alarm = DeviceAlarm(1)
    states = [alarm.active]
    alarm.failed(TIMEOUT, 100)
    states.append(alarm.active)
    alarm.ended(200)
    states.append(alarm.active)
    assert [state is True for state in states] == [False, True, False]
    assert None not in states


@pytest.mark.parametrize("code", PRECEDENCE)
def test_every_error_of_the_line_is_shown_when_it_rises_and_gone_when_it_ends(code: LineFaultCode) -> None:
    alarm = LineAlarm()
    assert alarm.failed(code, "so it is", 100) is True
    assert (alarm.payload()["active"], alarm.payload()["code"], alarm.payload()["message"]) == (True, code, "so it is")
    assert alarm.ended(frozenset({code}), 200) is True
    assert alarm.payload() == {**FINE, "last_code": code, "cleared": 200}


def test_an_id_answered_twice_stands_whatever_the_polls_say() -> None:
    twice = Fault(FaultCode.DUPLICATE_ID, "slave 1 is answered for twice")
    alarm = DeviceAlarm(2)
    assert alarm.set_lasting(twice, 1000)
    assert not alarm.set_lasting(twice, 1500)
    assert (alarm.payload()["code"], alarm.payload()["also"], alarm.payload()["since"]) == ("duplicate_id", [], 1000)
    assert not alarm.ended(2000)
    assert alarm.payload()["active"] is True
    silence = Fault(FaultCode.TIMEOUT, "no answer")
    assert [alarm.failed(silence, 3000), alarm.failed(silence, 4000)] == [False, True]
    assert (alarm.payload()["code"], alarm.payload()["also"]) == ("timeout", ["duplicate_id"])
    assert alarm.ended(5000)
    assert alarm.payload()["code"] == "duplicate_id"
    assert alarm.set_lasting(None, 6000)
    assert not alarm.set_lasting(None, 7000)
    assert (alarm.payload()["last_code"], alarm.payload()["cleared"]) == ("duplicate_id", 6000)


def test_what_stands_may_end_while_the_polls_fail() -> None:
    alarm = DeviceAlarm(1)
    alarm.set_lasting(Fault(FaultCode.DUPLICATE_ID, "twice"), 1000)
    alarm.failed(Fault(FaultCode.TIMEOUT, "no answer"), 2000)
    assert alarm.set_lasting(None, 3000)
    assert (alarm.payload()["code"], alarm.payload()["also"]) == ("timeout", [])
