"""Who speaks next: classes of jobs, probes and polls, the port's loss, and one reading per poll."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from lfs10d.jobs.job import Again, Ask, Done, Hold, Later, Next
from lfs10d.jobs.poll import Poll
from lfs10d.modbus.exchange import LateAnswer, Outcome
from lfs10d.modbus.frames import Codec, Framing, ReadRegisters
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Errand, Fault, FaultCode, Reading
from lfs10d.roster import DeviceSpec, PollRules
from lfs10d.schedule import Rest, Schedule

if TYPE_CHECKING:
    from collections.abc import Iterable

RTU = Codec(Framing.RTU)
LFS10 = load_profile("lfs10", relative_to=Path())
T9600 = LineTiming.of(9600)
GONE = Fault(FaultCode.PORT_LOST, "gone")
NONE: frozenset[int] = frozenset()
VALUES = {0x0001: (0x414F, 0xD70A), 0x0005: (1,)}
TAKES = 0.03


def spec(slave: int, interval: float = 1.0, *, name: str = "", enabled: bool = True) -> DeviceSpec:
    return DeviceSpec(name or f"slave-{slave}", slave, LFS10, RTU, interval, enabled)


class Task:
    """A job that says what it is told to say, one word after the other; then it is done."""

    def __init__(self, *words: Ask | Hold | Next, share: float = 1.0, excludes: frozenset[int] = NONE) -> None:
        self.words = list(words)
        self.share = share
        self.excludes = excludes
        self.errand = Errand.SCAN
        self.over_at: float | None = None

    def ask(self, now: float) -> Ask | Hold | Done:  # noqa: ARG002 - a job
        word = self.words.pop(0) if self.words else Done()
        assert isinstance(word, Ask | Hold | Done)
        return word

    def heard(self, outcome: Outcome, now: float) -> Next:  # noqa: ARG002 - a job
        word = self.words.pop(0) if self.words else Done()
        assert isinstance(word, Later | Again | Done)
        return word

    def cut_off(self, now: float) -> None:
        self.over_at = now


def asking(slave: int) -> Ask:
    return Ask(ReadRegisters(slave, 0x0004, 1), RTU, 0.2)


class Rig:
    """A schedule and a line whose `dead` slaves are silent."""

    def __init__(self, *specs: DeviceSpec, rules: PollRules | None = None) -> None:
        self.now = 0.0
        self.schedule = Schedule(T9600, 0.0)
        self.rules = rules or PollRules()
        self.schedule.replace(specs, self.rules, 0.0)
        self.dead: set[int] = set()
        self.asked: list[int] = []

    def replace(self, *specs: DeviceSpec) -> None:
        self.schedule.replace(specs, self.rules, self.now)

    def outcome(self, ask: Ask, late: Iterable[LateAnswer] = ()) -> Outcome:
        request = ask.request
        assert isinstance(request, ReadRegisters)
        silent = request.slave in self.dead
        ended = self.now + (ask.timeout if silent else TAKES)
        return Outcome(
            request=request,
            answer=None if silent else VALUES.get(request.address, (0,)),
            fault=Fault(FaultCode.TIMEOUT, "no answer") if silent else None,
            asked=self.now,
            began=self.now,
            sent_end=self.now,
            gap=0.004,
            ended=ended,
            turnaround=None if silent else 0.005,
            rtt=None if silent else TAKES,
            answered=not silent,
            late=tuple(late),
            echoed=None,
            sent=b"",
            heard=b"",
            unsolicited=0,
            quiet_since=ended,
        )

    def ask(self) -> Ask | None:
        """Have the schedule decide; None where nobody wants the line now."""
        decision = self.schedule.next(self.now)
        if isinstance(decision, Rest):
            assert decision.until > self.now
            return None
        self.asked.append(decision.request.slave)
        return decision

    def settle(self, ask: Ask, late: Iterable[LateAnswer] = ()) -> list[Reading]:
        outcome = self.outcome(ask, late)
        self.now = outcome.ended
        return self.schedule.settled(outcome, self.now)

    def run(self, until: float) -> list[Reading]:
        """Carry out what is wanted until then; return the readings."""
        readings: list[Reading] = []
        while self.now < until:
            decision = self.schedule.next(self.now)
            if isinstance(decision, Ask):
                self.asked.append(decision.request.slave)
                readings += self.settle(decision)
            else:
                assert decision.until > self.now
                self.now = min(decision.until, until)
        return readings

    def poll_of(self, name: str, request: int = 1) -> Poll:
        device = self.schedule.devices[name]
        return Poll(device, self.schedule.unanswered, due=self.now, errand=Errand.REQUEST, request=request)


def test_with_nobody_to_poll_it_rests() -> None:
    assert Rig().schedule.next(0.0) == Rest(inf)
    assert Rig(spec(1, enabled=False)).schedule.next(0.0) == Rest(inf)


def test_a_poll_is_one_reading() -> None:
    rig = Rig(spec(1))
    (reading,) = rig.run(0.5)
    assert (reading.device, reading.values, reading.rtt) == ("slave-1", {"wind_speed": 12.99}, TAKES)
    assert reading.online
    assert not reading.probe
    assert rig.schedule.next(0.5) == Rest(1.0)
    assert rig.schedule.errand is Errand.POLL


def test_an_outcome_without_a_question_is_a_mistake() -> None:
    rig = Rig(spec(1))
    with pytest.raises(RuntimeError):
        rig.schedule.settled(rig.outcome(asking(1)), 1.0)


def test_requests_go_before_polls_and_jobs_in_their_share_too() -> None:
    rig = Rig(spec(1, 0.0))
    rig.run(0.1)
    rig.schedule.submit(Task(asking(7), share=0.3), rig.now)
    rig.schedule.submit(Task(asking(8)), rig.now)
    rig.asked.clear()
    rig.run(rig.now + 0.1)
    assert rig.asked[:3] == [8, 7, 1]


def test_a_job_in_its_share_leaves_the_rest_to_the_polls() -> None:
    rig = Rig(spec(1, 0.0))
    words = [word for _ in range(1000) for word in (asking(7), Later(0.0))]
    rig.schedule.submit(Task(*words, share=0.3), 0.0)
    rig.run(20.0)
    assert rig.asked.count(7) / len(rig.asked) == pytest.approx(0.3, abs=0.03)


def test_a_job_that_has_nothing_to_ask_is_over_and_its_slave_ids_are_free() -> None:
    rig = Rig(spec(1, 0.0))
    rig.schedule.submit(Task(excludes=frozenset({1})), 0.0)
    rig.run(0.1)
    assert set(rig.asked) == {1}


def test_another_interval_is_another_grid_of_the_same_device() -> None:
    rig = Rig(spec(1, 1.0))
    rig.run(5.5)
    device = rig.schedule.devices["slave-1"]
    rig.replace(spec(1, 0.25))
    assert rig.schedule.devices["slave-1"] is device
    assert len(rig.run(10.5)) == 20


def test_a_slice_of_a_job_is_not_interrupted() -> None:
    rig = Rig(spec(1, 0.0))
    rig.run(0.1)
    rig.schedule.submit(Task(asking(7), Again(), asking(8), Again(), asking(9), share=0.1), rig.now)
    rig.asked.clear()
    rig.run(rig.now + 0.2)
    assert rig.asked[:4] == [7, 8, 9, 1]


def test_others_are_polled_while_a_job_rests_and_it_may_be_woken() -> None:
    rig = Rig(spec(1, 0.0))
    resting, asleep = Task(Hold(0.5), asking(7)), Task(Hold(), asking(8))
    rig.schedule.submit(resting, 0.0)
    rig.schedule.submit(asleep, 0.0)
    rig.run(0.4)
    assert set(rig.asked) == {1}
    rig.run(0.6)
    assert set(rig.asked) == {1, 7}
    rig.schedule.wake(asleep, rig.now)
    rig.schedule.wake(resting, rig.now)
    assert rig.ask() == asking(8)
    assert rig.schedule.errand is Errand.SCAN


def test_a_slave_id_that_a_job_excludes_is_polled_by_nobody_else() -> None:
    rig = Rig(spec(1, 0.1), spec(2, 0.1))
    rig.schedule.submit(Task(Hold(1.0), asking(1), excludes=frozenset({1})), 0.0)
    rig.run(0.99)
    assert set(rig.asked) == {2}
    rig.run(3.0)
    assert {1, 2} == set(rig.asked[-5:])


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


def test_with_nobody_answering_one_that_is_silent_after_another_is_asked_twice() -> None:
    rig = Rig(spec(1, 10.0), spec(2, 10.0))
    rig.dead = {1, 2}
    rig.run(0.7)
    assert rig.asked == [1, 2, 2]


def test_late_answers_are_learned_whoever_asked_but_not_what_is_later_than_any_time_out() -> None:
    rig = Rig(spec(1), spec(2))
    ask = rig.ask()
    assert ask is not None
    wind = ReadRegisters(2, 0x0001, 2)
    late = [LateAnswer(wind, 0.4), LateAnswer(wind, 7.0), LateAnswer(replace(wind, slave=9), 0.4)]
    rig.settle(ask, late)
    assert rig.schedule.devices["slave-2"].turnarounds.p99 == 0.4
    assert rig.schedule.devices["slave-1"].turnarounds.p99 == 0.005


def test_the_answer_of_an_unknown_slave_teaches_nothing() -> None:
    rig = Rig(spec(1, 10.0))
    rig.run(0.5)
    rig.schedule.submit(Task(asking(9)), rig.now)
    rig.run(1.0)
    assert rig.asked[-1] == 9
    assert len(rig.schedule.devices["slave-1"].turnarounds) == 1


def test_another_rate_forgets_what_was_learned_and_another_gap_does_not() -> None:
    rig = Rig(spec(1))
    rig.run(0.5)
    rig.schedule.retime(LineTiming.of(9600, extra_gap=0.01))
    kept = rig.schedule.devices["slave-1"].turnarounds.p99
    rig.schedule.retime(LineTiming.of(19200))
    assert (kept, rig.schedule.devices["slave-1"].turnarounds.p99) == (0.005, None)


def test_the_loss_of_the_port_is_one_reading_per_device_and_ends_every_job() -> None:
    rig = Rig(spec(1), spec(2), spec(3, enabled=False), spec(4, enabled=False))
    rig.run(0.5)
    waiting, resting, asking_now = Task(asking(7)), Task(Hold()), Task(asking(8))
    for job in (resting, asking_now, waiting):
        rig.schedule.submit(job, rig.now)
    rig.schedule.submit(rig.poll_of("slave-3", 33), rig.now)
    assert rig.ask() == asking(8)
    readings = rig.schedule.port_lost(GONE, 1.0)
    assert [(reading.device, reading.fault, reading.requests) for reading in readings] == [
        ("slave-1", GONE, ()),
        ("slave-2", GONE, ()),
        ("slave-3", GONE, (33,)),
    ]
    assert not any(reading.online for reading in readings)
    assert [job.over_at for job in (waiting, resting, asking_now)] == [1.0] * 3
    assert [each.request for each in rig.schedule.unanswered.earlier(8)] == [asking(8).request]
    assert rig.schedule.next(1.0) == Rest(inf)
    busy = Fault(FaultCode.PORT_BUSY, "taken")
    assert rig.schedule.port_lost(busy, 2.0) == []
    (told,) = rig.schedule.submit(rig.poll_of("slave-1", 34), 3.0)
    assert (told.fault, told.requests) == (busy, (34,))
    late = Task(asking(9))
    assert rig.schedule.submit(late, 3.0) == []
    assert late.over_at == 3.0


def test_when_the_port_is_back_all_are_due_at_once() -> None:
    rig = Rig(spec(1, 100.0), spec(2, 100.0))
    rig.run(5.0)
    rig.schedule.port_lost(GONE, 5.0)
    rig.replace(spec(1, 100.0), spec(2, 100.0), spec(3, 100.0))
    assert not rig.schedule.devices["slave-3"].online
    rig.now = 50.0
    rig.schedule.port_opened(50.0)
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
    rig.schedule.submit(poll, rig.now)
    rig.replace(spec(2, 100.0))
    rig.asked.clear()
    assert rig.schedule.submit(stale, rig.now) == []
    rig.run(3.0)
    assert rig.asked == []
    assert (poll.at, stale.at) == (1.0, 1.0)


def test_a_requested_poll_does_not_disturb_the_one_in_progress() -> None:
    rig = Rig(spec(1, 0.5))
    rig.run(0.9)
    rig.dead = {1}
    rig.run(1.05)
    rig.schedule.submit(rig.poll_of("slave-1", 5), rig.now)
    rig.dead = set()
    readings = rig.run(4.0)
    assert [reading.requests for reading in readings].count((5,)) == 1
    assert sum(1 + reading.overruns for reading in readings if not reading.requests) == pytest.approx(6, abs=1)
