"""What is asked next while earlier requests may still be answered."""

from __future__ import annotations

from lfs10d.modbus.request import WriteRegister
from tests.support.pending_lines import RTU, WHO, WIND, Line

# -- what is asked next


def test_what_cannot_be_mistaken_is_asked_at_once() -> None:
    line = Line()
    assert line.pending.next_request(WIND, RTU, 0.0, barrier=WHO, timeout=0.2) is WIND
    assert line.pending.next_request(WIND, RTU, 0.0, barrier=WHO, timeout=0.2, barrier_first=True) is WHO


def test_the_barrier_goes_before_what_could_be_mistaken() -> None:
    line = Line()
    line.silent(WIND, 0.0)
    assert line.pending.next_request(WIND, RTU, 0.3, barrier=WHO, timeout=0.2) is WHO
    assert line.pending.next_request(WHO, RTU, 0.3, barrier=WIND, timeout=0.2) is WHO


def test_a_slave_without_a_barrier_is_left_alone_until_nothing_is_pending() -> None:
    line = Line()
    line.silent(WIND, 0.0)
    until = line.pending.next_request(WIND, RTU, 0.3, barrier=None, timeout=0.2)
    assert isinstance(until, float)
    assert until > 0.9
    assert line.pending.next_request(WHO, RTU, 0.4, barrier=None, timeout=0.2) == until
    assert line.pending.next_request(WIND, RTU, until, barrier=None, timeout=0.2) is WIND


def test_what_is_left_alone_long_enough_already_is_asked() -> None:
    line = Line()
    line.silent(WIND, 0.0)
    assert line.pending.next_request(WIND, RTU, 9.0, barrier=None, timeout=0.2) is WIND


def test_after_the_barrier_what_lingers_is_waited_for() -> None:
    line = Line()
    line.silent(WIND, 0.0)
    line.answered(WHO, 0.3)
    until = line.pending.next_request(WIND, RTU, 0.4, barrier=WHO, timeout=0.2)
    assert isinstance(until, float)
    assert 0.4 < until < 1.2


def test_a_write_is_not_held_back_by_a_write_that_may_still_be_answered() -> None:
    line = Line()
    write = WriteRegister(1, 5, 7)
    line.silent(write, 0.0)
    assert line.pending.next_request(write, RTU, 0.3, barrier=WHO, timeout=0.2) is write
