"""What is asked next: classes of jobs, probes and polls, the port's loss, and one reading per poll."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import inf

import pytest

from lfs10d.line.device import PollRules
from lfs10d.line.jobs.job import Hold, Requeue
from lfs10d.line.scheduler import Rest
from lfs10d.modbus.duplicates import WATCHED
from lfs10d.modbus.timing import LineTiming
from lfs10d.reading import Fault, FaultCode, Purpose
from tests.support.schedules import GONE, RTU, T9600, TAKES, Rig, Task, asking, spec


def test_with_nobody_to_poll_it_rests() -> None:
    assert Rig().scheduler.next(0.0) == Rest(inf)
    assert Rig(spec(1, enabled=False)).scheduler.next(0.0) == Rest(inf)


def test_a_poll_is_one_reading() -> None:
    rig = Rig(spec(1))
    (reading,) = rig.run(0.5)
    assert (reading.device, reading.values, reading.rtt) == ("slave-1", {"wind_speed": 12.99}, TAKES)
    assert reading.online
    assert not reading.probe
    assert rig.scheduler.next(0.5) == Rest(1.0)
    assert rig.scheduler.purpose is Purpose.POLL


def test_the_line_hurries_flat_out_and_where_a_job_or_a_probe_waits() -> None:
    rig = Rig(spec(1), spec(2))
    rig.run(0.5)
    scheduler = rig.scheduler
    assert scheduler.patient(0.5)
    scheduler.submit(Task(asking(7), share=0.3), 0.5)
    assert not scheduler.patient(0.5)
    flat_out = Rig(spec(1, 0.0))
    flat_out.scheduler.next(0.0)  # it is on the line, and waits for nothing else
    assert not flat_out.scheduler.patient(0.0)


def test_a_job_that_rests_does_not_hurry_the_line_before_its_rest_is_over() -> None:
    rig = Rig(spec(1), spec(2))
    rig.scheduler.submit(Task(Hold(0.7), asking(7)), 0.0)
    rig.run(0.5)
    assert rig.scheduler.patient(0.5)
    assert not rig.scheduler.patient(0.7)


def test_an_outcome_without_a_question_is_a_mistake() -> None:
    rig = Rig(spec(1))
    with pytest.raises(RuntimeError, match=r"^an outcome without an Ask$"):
        rig.scheduler.on_outcome(rig.outcome(asking(1)), 1.0)


def test_while_a_second_answer_is_awaited_nobody_is_asked() -> None:
    rig = Rig(spec(1), spec(2, 0.0))
    duplicates = rig.scheduler.pending.duplicates
    duplicates.answered(1, -1.0)
    duplicates.second(1, -0.9)
    ask = asking(1)
    rig.scheduler.submit(Task(ask), 0.0)
    assert rig.ask() == ask
    outcome = rig.outcome(ask)
    rig.settle(ask)
    rig.scheduler.second_answers.on_answer(outcome)
    assert rig.scheduler.next(rig.now) == Rest(rig.now + WATCHED)
    rig.now += WATCHED
    assert rig.ask() is not None


def test_another_interval_is_another_grid_of_the_same_device() -> None:
    rig = Rig(spec(1, 1.0))
    rig.run(5.5)
    device = rig.scheduler.devices["slave-1"]
    rig.replace(spec(1, 0.25))
    assert rig.scheduler.devices["slave-1"] is device
    assert len(rig.run(10.5)) == 20


def test_a_poll_that_must_leave_its_slave_alone_does_not_hold_up_others() -> None:
    rig = Rig(spec(1, 0.0), spec(2, 0.0))
    rig.run(0.5)
    rig.dead = {1}
    rig.asked.clear()
    while 1 not in rig.asked:
        rig.run(rig.now + 0.01)
    rig.dead = set()
    lost = rig.now
    readings = rig.run(lost + 3.0)
    (first, *_) = [reading for reading in readings if reading.device == "slave-1"]
    assert first.failed_attempts == (FaultCode.TIMEOUT,)
    assert first.at > lost + 0.8
    assert sum(reading.device == "slave-2" and reading.at < lost + 0.8 for reading in readings) > 20


def test_another_rate_forgets_what_was_learned_and_another_gap_does_not() -> None:
    rig = Rig(spec(1))
    rig.run(0.5)
    rig.scheduler.retime(LineTiming.of(9600, extra_gap=0.01))
    kept = rig.scheduler.devices["slave-1"].response_times.p99
    rig.scheduler.retime(LineTiming.of(19200))
    assert (kept, rig.scheduler.devices["slave-1"].response_times.p99) == (0.005, None)


def test_the_loss_of_the_port_is_one_reading_per_device_and_ends_every_job() -> None:
    rig = Rig(spec(1), spec(2), spec(3, enabled=False), spec(4, enabled=False))
    rig.run(0.5)
    waiting, resting, asking_now = Task(asking(7)), Task(Hold()), Task(asking(8))
    for job in (resting, asking_now, waiting):
        rig.scheduler.submit(job, rig.now)
    rig.scheduler.submit(rig.poll_of("slave-3", 33), rig.now)
    assert rig.ask() == asking(8)
    readings = rig.scheduler.on_port_lost(GONE, 1.0)
    assert [(reading.device, reading.fault, reading.requests) for reading in readings] == [
        ("slave-1", GONE, ()),
        ("slave-2", GONE, ()),
        ("slave-3", GONE, (33,)),
    ]
    assert not any(reading.online for reading in readings)
    assert [job.over_at for job in (waiting, resting, asking_now)] == [1.0] * 3
    assert [each.request for each in rig.scheduler.pending.earlier(8)] == [asking(8).request]
    assert rig.scheduler.next(1.0) == Rest(inf)
    busy = Fault(FaultCode.PORT_BUSY, "taken")
    assert rig.scheduler.on_port_lost(busy, 2.0) == []
    (told,) = rig.scheduler.submit(rig.poll_of("slave-1", 34), 3.0)
    assert (told.fault, told.requests) == (busy, (34,))
    late = Task(asking(9))
    assert rig.scheduler.submit(late, 3.0) == []
    assert late.over_at == 3.0


def test_when_the_port_is_back_all_are_due_at_once() -> None:
    rig = Rig(spec(1, 100.0), spec(2, 100.0))
    rig.run(5.0)
    rig.scheduler.on_port_lost(GONE, 5.0)
    rig.replace(spec(1, 100.0), spec(2, 100.0), spec(3, 100.0))
    assert not rig.scheduler.devices["slave-3"].online
    rig.now = 50.0
    rig.scheduler.on_port_opened(50.0)
    readings = rig.run(51.0)
    assert {reading.device for reading in readings} == {"slave-1", "slave-2", "slave-3"}
    assert all(reading.values for reading in readings)


def test_a_poll_whose_device_was_replaced_meanwhile_is_told_to_nobody() -> None:
    rig = Rig(spec(1, 100.0))
    ask = rig.ask()
    rig.replace(spec(1, 100.0, name="mast-top"))
    assert ask is not None
    assert rig.settle(ask) == []
    (reading,) = rig.run(1.0)
    assert reading.device == "mast-top"


def test_polls_in_progress_go_on_through_a_change_and_those_of_the_gone_do_not() -> None:
    rig = Rig(spec(1, 0.3), spec(2, 0.3))
    rig.run(0.2)
    rig.dead = {1, 2}
    while len(rig.asked) < 4:
        rig.run(rig.now + 0.01)
    assert rig.asked[-2:] == [1, 2]
    rig.dead = set()
    rig.replace(spec(1, 0.3))
    (first, *_) = rig.run(rig.now + 2.0)
    assert first.device == "slave-1"
    assert first.failed_attempts == (FaultCode.TIMEOUT,)
    assert 2 not in rig.asked[4:]


def test_a_requested_poll_of_one_that_is_gone_is_cut_off() -> None:
    rig = Rig(spec(1, 100.0), spec(2, 100.0))
    rig.run(1.0)
    poll, stale = rig.poll_of("slave-1"), rig.poll_of("slave-1")
    rig.scheduler.submit(poll, rig.now)
    rig.replace(spec(2, 100.0))
    rig.asked.clear()
    assert rig.scheduler.submit(stale, rig.now) == []
    rig.run(3.0)
    assert rig.asked == []
    assert (poll.at, stale.at) == (1.0, 1.0)


def test_a_requested_poll_does_not_disturb_the_one_in_progress() -> None:
    rig = Rig(spec(1, 0.5))
    rig.run(0.9)
    rig.dead = {1}
    rig.run(1.05)
    rig.scheduler.submit(rig.poll_of("slave-1", 5), rig.now)
    rig.dead = set()
    readings = rig.run(4.0)
    assert [reading.requests for reading in readings].count((5,)) == 1
    assert sum(1 + reading.overruns for reading in readings if not reading.requests) == pytest.approx(6, abs=1)


def test_while_the_port_is_lost_nothing_is_told_of_a_device_that_is_gone() -> None:
    rig = Rig(spec(1), spec(2))
    stale = rig.poll_of("slave-2")
    rig.replace(spec(1))
    lost = rig.scheduler.on_port_lost(GONE, 1.0)
    assert [(reading.device, reading.at) for reading in lost] == [("slave-1", 1.0)]
    assert rig.scheduler.submit(stale, 2.0) == []
    (told,) = rig.scheduler.submit(rig.poll_of("slave-1"), 3.0)
    assert told.at == 3.0


def test_when_the_port_is_back_what_a_lost_job_excluded_is_free_and_jobs_are_carried_out() -> None:
    rig = Rig(spec(1))
    rig.scheduler.submit(Task(asking(1), excludes=frozenset({1})), 0.0)
    assert rig.ask() == asking(1)
    rig.scheduler.on_port_lost(GONE, 0.5)
    assert [each.codec for each in rig.scheduler.pending.earlier(1)] == [RTU]
    rig.now = 1.0
    rig.scheduler.on_port_opened(1.0)
    rig.scheduler.submit(Task(asking(7)), 1.0)
    rig.asked.clear()
    rig.run(1.5)
    assert rig.asked == [7, 1]


def test_a_requested_poll_that_is_tried_again_goes_before_others_that_are_due() -> None:
    rig = Rig(spec(1, 100.0), spec(2, 1.0))
    rig.run(1.5)
    rig.dead = {1}
    rig.scheduler.submit(rig.poll_of("slave-1"), 1.95)
    rig.now = 1.95
    rig.asked.clear()
    rig.run(2.2)
    assert rig.asked[:2] == [1, 1]


def test_a_requested_poll_whose_device_goes_while_it_is_on_the_line_is_over_then() -> None:
    rig = Rig(spec(1, 100.0))
    rig.run(1.0)
    poll = rig.poll_of("slave-1")
    rig.scheduler.submit(poll, rig.now)
    ask = rig.ask()
    rig.replace()
    assert ask is not None
    assert rig.settle(ask) == []
    assert poll.at == rig.now


def test_polls_of_slow_devices_follow_each_other() -> None:
    rig = Rig(spec(1, 100.0), spec(2, 100.0))
    assert rig.scheduler.devices["slave-2"].due == pytest.approx(T9600.exchange(8, 9))


def test_a_slave_is_asked_no_sooner_than_its_rest_allows_and_others_have_the_line_meanwhile() -> None:
    rig = Rig(replace(spec(1, 100.0), request_gap=0.5), spec(2, 0.0))
    rig.run(0.2)
    rig.scheduler.submit(Task(asking(1), Requeue(0.0), asking(1)), rig.now)
    rig.scheduler.submit(rig.poll_of("slave-1", 5), rig.now)
    readings = rig.run(3.0)
    of_1 = [(began, ended) for slave, began, ended in rig.times if slave == 1]
    assert len(of_1) == 4
    assert all(later[0] - before[1] >= 0.5 for before, later in pairwise(of_1))
    assert [reading.requests for reading in readings if reading.device == "slave-1"] == [(5,)]
    assert len(rig.times) - 4 > 0.9 * 3.0 / TAKES - 4


def test_a_poll_goes_on_when_its_silence_has_widened_the_gap_and_the_gap_outlasts_another_id() -> None:
    rig = Rig(spec(1, 100.0), rules=PollRules(retries=0))
    device = rig.scheduler.devices["slave-1"]
    for began in (-20.0, -10.0):
        device.gap.exchanged(began, began + 0.02, spoke=True, silent=False)
        if began < -15.0:
            device.gap.exchanged(began + 0.03, began + 0.2, spoke=False, silent=True)
    device.gap.exchanged(-0.03, -0.01, spoke=True, silent=False)
    rig.dead = {1}
    ask = rig.ask()
    assert ask is not None
    assert rig.settle(ask) == []
    assert device.gap.learned == 0.1
    rig.dead = set()
    (reading,) = rig.run(4.0)
    assert (reading.fault, reading.gap_learned) == (None, True)
    rig.replace(replace(spec(7, 100.0), name="slave-1"))
    assert rig.scheduler.devices["slave-1"].gap is device.gap
    other = spec(7).profile.model_copy(update={"title": "Another"})
    rig.replace(replace(spec(7, 100.0), name="slave-1", profile=other))
    assert rig.scheduler.devices["slave-1"].gap.learned == 0
