"""Devices that are silent: asked twice, probed, and what answers teach."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

from lfs10d.line.device import LEARNED_MOST, Health, PollRules
from lfs10d.line.devices import START_PATIENT
from lfs10d.line.scheduler import Rest
from lfs10d.modbus.outcome import LateAnswer
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import Fault, FaultCode, Purpose
from tests.support.schedules import Rig, Task, asking, spec


def test_one_that_is_offline_is_probed_and_back_on_its_grid() -> None:
    rig = Rig(spec(1, 0.5), spec(2, 0.5))
    rig.run(2.0)
    rig.dead = {1}
    readings = rig.run(30.0)
    assert [reading.probe for reading in readings if reading.device == "slave-1"][-3:] == [True, True, True]
    rig.dead = set()
    back = [reading for reading in rig.run(50.0) if reading.device == "slave-1"]
    assert back[0].probe
    assert back[0].online
    assert len(back) > 10
    assert sum(reading.overruns for reading in back) <= 1


def test_one_that_is_silent_after_another_is_asked_twice_at_its_first_poll_and_three_polls_are_made_at_once() -> None:
    rig = Rig(spec(1, 10.0), spec(2, 10.0))
    rig.dead = {1, 2}
    readings = rig.run(3.3)
    assert rig.asked == [1, 2, 2, 1, 2, 1, 2]
    assert [(reading.device, reading.online, reading.probe) for reading in readings] == [
        ("slave-1", False, False), ("slave-2", False, False)
    ] * 3  # fmt: skip
    assert [readings[-2].at, readings[-1].at] == pytest.approx([2.4, 3.4])


def test_with_many_silent_at_the_start_none_is_waited_for_long() -> None:
    dead = range(1, START_PATIENT + 2)
    rig = Rig(*(spec(slave, 100.0) for slave in dead))
    rig.dead = set(dead)
    readings = rig.run(0.4 * len(dead) + 1.0)
    at = [reading.at for reading in readings if reading.at > 0.4 * len(dead)]
    assert [later - earlier for earlier, later in pairwise(at)] == pytest.approx([0.2] * (len(at) - 1))


def test_one_that_answers_badly_is_polled_on_its_grid_though_it_is_offline() -> None:
    rig = Rig(spec(1, 1.0), spec(2, 1.0), rules=PollRules(retries=0))
    rig.run(0.5)
    rig.dead = {2}
    rig.run(8.5)
    device = rig.scheduler.devices["slave-2"]
    assert (device.health, device.doubtful) == (Health.OFFLINE, True)
    rig.dead, rig.garbage = set(), {2}
    while device.doubtful:
        rig.run(rig.now + 0.1)
    found = rig.now
    readings = [reading for reading in rig.run(found + 20.0) if reading.device == "slave-2"]
    assert len(readings) == pytest.approx(20, abs=1)
    assert not any(reading.online or reading.probe or reading.overruns for reading in readings[1:])
    rig.dead, rig.garbage = {2}, set()
    rig.run(rig.now + 1.5)
    assert device.doubtful


def test_late_answers_are_learned_whoever_asked_but_not_what_is_later_than_any_time_out() -> None:
    rig = Rig(spec(1), spec(2))
    ask = rig.ask()
    assert ask is not None
    wind = ReadRegisters(2, 0x0001, 2)
    late = [LateAnswer(wind, 0.4), LateAnswer(wind, 7.0), LateAnswer(replace(wind, slave=9), 0.4)]
    rig.settle(ask, late)
    assert rig.scheduler.devices["slave-2"].response_times.p99 == 0.4
    assert rig.scheduler.devices["slave-1"].response_times.p99 == 0.005


def test_the_answer_of_an_unknown_slave_teaches_nothing() -> None:
    rig = Rig(spec(1, 10.0))
    rig.run(0.5)
    rig.scheduler.submit(Task(asking(9)), rig.now)
    rig.run(1.0)
    assert rig.asked[-1] == 9
    assert len(rig.scheduler.devices["slave-1"].response_times) == 1


def test_a_single_dead_device_is_probed_and_the_line_rests_until_then() -> None:
    rig = Rig(spec(1, 0.5), rules=PollRules(offline_after=1))
    rig.dead = {1}
    *_, first = rig.run(1.7)  # three polls at once
    decision = rig.scheduler.next(rig.now)
    assert not first.online
    assert isinstance(decision, Rest)
    assert decision.until == pytest.approx(2.6, abs=0.1)
    rig.now = decision.until
    ask = rig.ask()
    assert ask is not None
    device = rig.scheduler.devices["slave-1"]
    assert rig.scheduler.purpose is Purpose.PROBE
    assert (device.polling, device.last_asked) == (True, rig.now)
    (reading,) = rig.settle(ask)
    assert reading.probe
    assert not device.polling


def test_one_never_heard_that_is_silent_after_another_is_asked_twice_though_somebody_answers() -> None:
    rig = Rig(spec(1, 100.0), spec(2, 100.0), spec(3, 100.0))
    rig.dead = {2, 3}
    rig.run(0.7)
    assert rig.asked == [1, 2, 3, 3, 2]


def test_one_that_answered_before_is_not_asked_again_at_once_for_the_silence_of_another() -> None:
    rig = Rig(spec(1, 1.0), spec(2, 1.0), spec(3, 1.0), rules=PollRules(retries=0))
    rig.run(1.9)
    rig.dead = {2, 3}
    rig.asked.clear()
    rig.run(2.9)
    assert rig.asked == [1, 2, 3]


def test_what_takes_exactly_the_longest_time_out_is_learned() -> None:
    rig = Rig(spec(1))
    ask = rig.ask()
    assert ask is not None
    rig.settle(ask, [LateAnswer(ReadRegisters(1, 0x0001, 2), LEARNED_MOST)])
    assert rig.scheduler.devices["slave-1"].response_times.p99 == LEARNED_MOST


def test_a_refusal_teaches_nothing_about_time_nor_does_an_answer_without_one() -> None:
    rig = Rig(spec(1))
    ask = rig.ask()
    assert ask is not None
    refused = replace(rig.outcome(ask), answer=None, fault=Fault(FaultCode.EXCEPTION, "refused", 2))
    rig.scheduler.on_outcome(refused, 0.1)
    rig.now = 1.0
    ask = rig.ask()
    assert ask is not None
    rig.scheduler.on_outcome(replace(rig.outcome(ask), turnaround=None), 1.1)
    assert len(rig.scheduler.devices["slave-1"].response_times) == 0


def test_those_probed_in_turn_after_the_first_answer_are_asked_twice_where_they_follow_a_silent_one() -> None:
    rig = Rig(*(spec(slave, 100.0) for slave in (1, 2, 3)), rules=PollRules(offline_after=1, retries=0))
    rig.run(1.0)
    rig.dead = {1, 2, 3}
    rig.run(150.0)
    rig.dead = {2, 3}
    while not rig.scheduler.devices["slave-1"].online:
        rig.run(rig.now + 0.01)
    rig.asked.clear()
    rig.run(rig.now + 0.65)
    assert rig.asked in ([2, 3, 3], [3, 2, 2])
