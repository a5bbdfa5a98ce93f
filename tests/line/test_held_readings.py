"""Readings held back for a moment: another answer may still show that theirs is a second one."""

from __future__ import annotations

from dataclasses import replace
from math import inf

from lfs10d.line.held_readings import HeldReadings
from lfs10d.reading import Fault, FaultCode, Reading

TWO = Fault(FaultCode.COLLISION, "two answers")


def reading(device: str, at: float) -> Reading:
    return Reading(device, at, {"wind_speed": 5.0}, None, 0.02, online=True, response_timeout=0.1)


def test_a_reading_is_released_when_its_time_is_over_the_earlier_first() -> None:
    held = HeldReadings()
    assert held.next_at == inf
    a, b, c = reading("a", 1.0), reading("b", 1.1), reading("c", 1.2)
    held.hold([a], 1.3, 1.3)
    held.hold([b, c], 1.25, 1.25)
    assert held.next_at == 1.25
    assert list(held.released(1.24)) == []
    assert list(held.released(1.25)) == [b, c]
    assert list(held.released(1.3)) == [a]
    assert list(held.released()) == []


def test_those_of_one_device_are_released_alone() -> None:
    held = HeldReadings()
    a, b = reading("a", 1.0), reading("b", 1.0)
    held.hold([a, b], 9.0, 9.0)
    assert list(held.released(device="b")) == [b]
    assert list(held.released()) == [a]


def test_a_second_answer_makes_the_reading_fail_that_is_held_back_and_no_other() -> None:
    held = HeldReadings()
    held.hold([reading("a", 1.0), reading("b", 1.0)], 1.2, 1.2)
    held.spoil("a", TWO, at=1.1)
    assert held.holds("b", 1.1)
    assert not held.holds("a", 1.1)
    assert not held.holds("b", 1.21)
    failed, other = held.released()
    assert (failed.values, failed.rtt, failed.fault, failed.at, failed.device) == (None, None, TWO, 1.0, "a")
    assert other == reading("b", 1.0)


def test_broken_bytes_may_be_its_own_answer_only_until_that_would_have_come_a_right_frame_always() -> None:
    held = HeldReadings()
    held.hold([reading("a", 1.0)], 1.2, 1.05)
    assert held.holds("a", 1.05)
    assert not held.holds("a", 1.06)
    held.spoil("a", TWO, at=1.19)
    (failed,) = held.released()
    assert failed.fault == TWO


def test_what_came_before_it_or_after_its_time_does_not() -> None:
    held = HeldReadings()
    held.hold([reading("a", 1.0)], 1.2, 1.2)
    held.spoil("a", TWO, at=1.0)
    held.spoil("a", TWO, at=1.21)
    assert list(held.released()) == [reading("a", 1.0)]


def test_one_that_failed_waits_for_nothing() -> None:
    held = HeldReadings()
    held.hold([reading("a", 1.0)], 1.2, 1.2)
    held.spoil("a", TWO, at=1.1)
    assert [each.fault for each in held.released(1.1)] == [TWO]


def test_until_they_are_proved_those_of_one_device_are_held_back_for_longer() -> None:
    held = HeldReadings()
    held.hold([reading("a", 1.0), reading("b", 1.0)], 1.2, 1.2)
    held.extend("a", 1.5, 1.4)
    assert held.holds("a", 1.4)
    assert not held.holds("b", 1.4)
    assert [each.device for each in held.released(1.3)] == ["b"]
    held.extend("a", 1.3, 1.3)
    assert list(held.released(1.4)) == []
    held.spoil("a", TWO, at=1.4)
    held.extend("a", 1.9, 1.9)
    assert [each.fault for each in held.released(1.41)] == [TWO]


def test_one_that_failed_by_itself_keeps_its_fault() -> None:
    held = HeldReadings()
    timeout = replace(reading("a", 1.0), values=None, rtt=None, fault=Fault(FaultCode.TIMEOUT, "no answer"))
    held.hold([timeout], 1.2, 1.2)
    held.spoil("a", TWO, at=1.1)
    assert list(held.released()) == [timeout]


def test_all_that_are_held_back_fail_where_nobody_knows_when_it_came() -> None:
    held = HeldReadings()
    held.hold([reading("a", 1.0), reading("b", 1.0)], 1.2, 1.2)
    held.spoil("a", TWO)
    assert [each.fault for each in held.released()] == [TWO, None]
