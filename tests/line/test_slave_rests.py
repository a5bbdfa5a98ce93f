"""Until when a slave is left in peace, whoever wants to ask it."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import pytest

from lfs10d.line.device import Device, PollRules
from lfs10d.line.jobs.poll import Poll
from lfs10d.line.slave_rests import SlaveRests
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.outcome import LateAnswer
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import Fault, FaultCode, Purpose
from tests.support.outcomes import ended
from tests.support.schedules import RTU, Task, spec

SILENCE = Fault(FaultCode.TIMEOUT, "no answer")


def a_device(slave: int, gap: float = 0.0, *, min_interval: float = 0.0) -> Device:
    known = spec(slave)
    profile = known.profile.model_copy(update={"min_interval": min_interval})
    device = Device(replace(known, profile=profile), PollRules(), slave)
    device.gap.configured = gap
    return device


def ask(slave: int, gap: float = 0.0, baudrate: int | None = None) -> Ask:
    return Ask(ReadRegisters(slave, 1, 2), RTU, 0.2, None, baudrate, request_gap=gap)


class Line:
    """The rests of a line with these devices."""

    def __init__(self, *devices: Device) -> None:
        self.rests = SlaveRests()
        self.devices = {device.slave: device for device in devices}

    def exchange(self, asked: Ask, began: float | None, over: float, fault: Fault | None = None) -> bool:
        outcome = ended(
            asked.request,
            fault=fault,
            answer=None if fault else (1, 2),
            answered=fault is None,
            began=began,
            ended=over,
        )
        return self.rests.learn(outcome, asked, self.devices, line_rate=9600)

    def until(self, asked: Ask, job: Task | Poll | None = None) -> float:
        return self.rests.until(job or Task(), asked, self.devices)


def test_a_slave_without_a_rest_need_not_wait() -> None:
    line = Line(a_device(1))
    line.exchange(ask(1), 1.0, 1.02)
    assert line.until(ask(1)) == line.until(ask(9)) == -inf


def test_the_rest_counts_from_the_end_of_any_exchange_with_the_slave() -> None:
    line = Line(a_device(1, 0.5), a_device(2))
    assert line.until(ask(1)) == -inf
    line.exchange(ask(1), 1.0, 1.25, SILENCE)
    line.exchange(ask(2), 2.0, 2.02)
    assert line.until(ask(1)) == pytest.approx(1.75)
    line.rests.abandoned(1, 3.0)
    assert line.until(ask(1)) == pytest.approx(3.5)
    line.exchange(ask(1), None, 9.0, Fault(FaultCode.COLLISION, "never sent"))
    assert line.until(ask(1)) == pytest.approx(3.5)


def test_a_job_may_know_of_a_rest_of_a_slave_that_is_not_configured() -> None:
    line = Line(a_device(1, 0.5))
    line.exchange(ask(7), 1.0, 1.02)
    line.exchange(ask(1), 1.0, 1.02)
    assert line.until(ask(7, 0.3)) == pytest.approx(1.32)
    assert line.until(ask(1, 0.3)) == pytest.approx(1.52)


def test_a_sensor_that_is_moved_rests_at_both_places() -> None:
    moving = Task(excludes=frozenset({1, 7}))
    line = Line(a_device(1, 0.5), a_device(2, 9.0))
    line.exchange(ask(1), 1.0, 1.02)
    assert line.until(ask(7), moving) == pytest.approx(1.52)
    line.exchange(ask(7), 2.0, 2.2, SILENCE)
    assert line.until(ask(1), moving) == pytest.approx(2.7)
    assert line.until(ask(1)) == pytest.approx(1.52)
    newcomer = Task(excludes=frozenset({7, 8}))
    assert line.until(ask(8), newcomer) == -inf
    assert line.until(ask(8, 0.1), newcomer) == pytest.approx(2.3)


def test_what_is_asked_directly_behind_another_question_at_a_place_where_nobody_is_does_not_wait() -> None:
    moving = Task(excludes=frozenset({1, 7}))
    line = Line(a_device(1, 0.5))
    line.exchange(ask(1), 1.0, 1.02)
    assert line.until(replace(ask(7, 0.5), at_once=True), moving) == -inf


def test_devices_that_share_a_job_rest_each_for_itself() -> None:
    all_of_them = Task(excludes=frozenset({1, 2}))
    line = Line(a_device(1, 0.5), a_device(2))
    line.exchange(ask(1), 1.0, 1.02)
    assert line.until(ask(2), all_of_them) == -inf


def test_a_poll_begins_no_sooner_than_the_shortest_interval_after_the_one_before_and_then_goes_on() -> None:
    device = a_device(1, min_interval=2.0)
    line = Line(device)
    device.polled_at = 1.0
    poll = Poll(device, PendingRequests(), due=1.5, purpose=Purpose.REQUEST)
    assert line.until(ask(1), poll) == 3.0
    assert line.until(ask(1)) == -inf
    poll.ask(3.0)
    poll.on_outcome(ended(ask(1).request, fault=Fault(FaultCode.CRC, "crc"), ended=3.1), 3.1)
    assert line.until(ask(1), poll) == -inf


def test_only_what_is_asked_at_the_lines_rate_of_a_device_teaches_what_rest_it_needs() -> None:
    line = Line(a_device(1))
    for asked, widened in ((ask(1, baudrate=19200), False), (ask(9), False), (ask(1, baudrate=9600), True)):
        told = []
        for began in (10.0, 20.0):
            line.exchange(asked, began, began + 0.02)
            told.append(line.exchange(asked, began + 0.024, began + 0.2, SILENCE))
        assert told == [False, widened]
    assert line.until(ask(1)) == pytest.approx(20.3)


def test_a_late_answer_is_no_silence_whoever_was_asked_when_it_came() -> None:
    device = a_device(1)
    line = Line(device)
    for began in (10.0, 20.0):
        line.exchange(ask(1), began, began + 0.02)
        line.exchange(ask(1), began + 0.024, began + 0.2, SILENCE)
        late = tuple(LateAnswer(ReadRegisters(slave, 1, 2), 0.4) for slave in (1, 9))
        outcome = ended(ask(2).request, fault=SILENCE, began=began + 0.3, ended=began + 0.5, late=late)
        line.rests.learn(outcome, ask(2), line.devices, line_rate=9600)
    assert device.gap.seconds == 0
