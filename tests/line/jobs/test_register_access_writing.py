"""A register written: once, after the echo is known, and read back."""

from __future__ import annotations

import pytest

from lfs10d.line.jobs.access_end import End
from lfs10d.line.jobs.job import Hold
from lfs10d.line.jobs.register_access import DIFFERING, ECHO_READS, VERIFY_WITHIN
from lfs10d.modbus.request import WriteRegister
from lfs10d.reading import Exchanged, Fault, FaultCode, Purpose, Reading
from tests.support.faulty_sensors import add_fault
from tests.support.register_accesses import AVERAGING, Rig, read


def write(value: int = 10, address: int = AVERAGING, slave: int = 7) -> WriteRegister:
    return WriteRegister(slave, address, value)


# -- writing


def test_a_write_is_read_back() -> None:
    rig = Rig()
    access = rig.do(write(10))
    assert (access.end, access.before, access.registers, access.sent) == (End.DONE, 1, (10,), True)
    assert rig.asked == [bytes.fromhex(each) for each in ("03 0010 0001", "06 0010 000A", "03 0010 0001")]
    assert rig.vane.words[AVERAGING] == 10


@pytest.mark.parametrize("adapter_echoes", [False, True])
def test_no_write_goes_out_before_three_reads_have_told_whether_the_adapter_echoes(*, adapter_echoes: bool) -> None:
    rig = Rig(echo="auto", adapter_echoes=adapter_echoes)
    assert rig.do(write(10)).end is End.DONE
    assert [each[0] for each in rig.asked] == [3, 3, 3, 6, 3]


def test_where_the_echo_cannot_be_learned_nothing_is_written() -> None:
    rig = Rig(echo="auto")
    access = rig.begin(write())
    access._echo_known = lambda: False
    rig.pass_time(5.0)
    assert (access.end, access.sent, rig.writes) == (End.ECHO_UNKNOWN, False, [])
    assert len(rig.asked) == 1 + ECHO_READS


def test_a_slave_that_falls_silent_while_the_echo_is_learned_is_not_written() -> None:
    rig = Rig(echo="auto")
    add_fault(rig.vane, "silent", first=0.04)
    access = rig.do(write())
    assert (access.end, access.sent, access.before, rig.writes) == (End.UNANSWERED, False, 1, [])


def test_a_silent_slave_is_not_written() -> None:
    rig = Rig()
    add_fault(rig.vane, "silent")
    access = rig.do(write())
    assert (access.end, access.sent, rig.writes) == (End.UNANSWERED, False, [])


def test_a_busy_slave_is_not_written() -> None:
    rig = Rig()
    add_fault(rig.vane, "exception", code=6)
    access = rig.do(write())
    assert (access.end, access.sent, rig.writes) == (End.BUSY, False, [])


def test_a_register_that_cannot_be_read_is_written_and_the_refusal_told() -> None:
    rig = Rig()
    access = rig.do(write(address=0x0999))
    assert (access.end, access.sent, access.before) == (End.REFUSED, True, None)
    words = "exception 02 illegal register address, writing 0x000A to 0x0999"
    assert access.fault == Fault(FaultCode.EXCEPTION, words, 2, access.fault.heard)  # type: ignore[union-attr]  # equal to a Fault it is one


def test_a_register_that_can_be_written_but_not_read_is_not_verified() -> None:
    rig = Rig(echo="auto")
    del rig.vane.words[AVERAGING]
    rig.vane._write = lambda body, *_: body  # type: ignore[method-assign]  # a device of a kind nobody simulates
    access = rig.do(write())
    assert (access.end, access.sent, access.registers) == (End.NOT_VERIFIED, True, None)


def test_a_write_that_is_answered_busy_is_not_tried_again() -> None:
    rig = Rig()
    add_fault(rig.vane, "exception", code=6, first=0.03)
    access = rig.do(write())
    assert (access.end, access.sent, len(rig.writes)) == (End.BUSY, True, 1)
    assert rig.asked[-1] == rig.writes[0]


def test_a_write_that_the_slave_confirms_but_does_not_make_is_not_verified() -> None:
    rig = Rig()
    rig.vane._write = lambda body, *_: body  # type: ignore[method-assign]  # as a register locked by a key switch
    access = rig.do(write(10))
    assert (access.end, access.registers, access.fault) == (End.NOT_VERIFIED, (1,), None)
    assert (len(rig.writes), len(rig.asked)) == (1, 2 + DIFFERING)


@pytest.mark.parametrize("kind", ["echo_losing", "wrong_echo"])
def test_a_write_without_its_answer_is_sent_once_and_read_back(kind: str) -> None:
    rig = Rig()
    add_fault(rig.vane, kind)
    access = rig.do(write(10))
    assert (access.end, access.registers, len(rig.writes)) == (End.DONE, (10,), 1)


def test_a_slave_that_stores_slowly_is_asked_until_it_answers() -> None:
    rig = Rig()
    add_fault(rig.vane, "slow_flash", delay=4.0)
    access = rig.do(write(10))
    assert (access.end, access.registers, len(rig.writes)) == (End.DONE, (10,), 1)


def test_a_slave_silent_after_a_write_is_given_up_after_a_while() -> None:
    rig = Rig()
    add_fault(rig.vane, "slow_flash", delay=60.0)
    access = rig.do(write(10))
    assert (access.end, access.sent, access.registers) == (End.UNANSWERED, True, None)
    assert VERIFY_WITHIN < rig.clock.now < VERIFY_WITHIN + 3


def test_a_lost_port_ends_it_and_says_whether_a_write_was_sent() -> None:
    rig = Rig()
    add_fault(rig.vane, "slow_flash", delay=60.0)
    access = rig.begin(write(10))
    rig.pass_time(0.5)
    rig.port.unplug()
    rig.pass_time(0.5)
    assert (access.end, access.sent, access.fault) == (End.CUT_OFF, True, None)
    second = rig.do(read())
    assert (second.end, second.sent) == (End.CUT_OFF, False)


def test_nobody_polls_the_slave_between_a_write_and_its_verification() -> None:
    rig = Rig(polled=True)
    rig.pass_time(2.0)
    begun = len(rig.events)
    add_fault(rig.vane, "slow_flash", delay=1.0)
    rig.do(write(10))
    assert {each.purpose for each in rig.events[begun:] if isinstance(each, Exchanged)} == {Purpose.REQUEST}
    rig.vane.faults.clear()
    rig.pass_time(1.0)
    assert [each.fault for each in rig.events if isinstance(each, Reading)][-1] is None


def test_an_access_rests_without_asking_while_it_waits() -> None:
    rig = Rig()
    access = rig.begin(read())
    access._rest_until = 5.0
    assert access.ask(4.9) == Hold(5.0)
