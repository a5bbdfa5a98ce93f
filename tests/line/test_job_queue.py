"""Requests go first, then jobs within their share, each in turn; a slave id that belongs to a job is left alone."""

from __future__ import annotations

from math import inf
from pathlib import Path

import pytest

from lfs10d.line.device import Device, DeviceSpec, PollRules
from lfs10d.line.job_queue import JOB_CREDIT, JobQueue
from lfs10d.line.jobs.job import Done, Hold, Next
from lfs10d.line.jobs.poll import Poll
from lfs10d.line.quota import Quota
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.pending import PendingRequests
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Purpose

NONE: frozenset[int] = frozenset()


class Task:
    """A job of a class; it is never asked here."""

    purpose = Purpose.SCAN

    def __init__(self, share: float = 1.0, excludes: frozenset[int] = NONE) -> None:
        self.share = share
        self.excludes = excludes

    def ask(self, now: float) -> Ask | Hold | Done:
        raise NotImplementedError

    def on_outcome(self, outcome: Outcome, now: float) -> Next:
        raise NotImplementedError

    def cut_off(self, now: float) -> None:
        raise NotImplementedError


def a_poll(slave: int) -> Poll:
    profile = load_profile("lfs10", relative_to=Path())
    spec = DeviceSpec(f"slave-{slave}", slave, profile, Codec(Framing.RTU), 1.0)
    return Poll(Device(spec, PollRules(), slave), PendingRequests(), due=0.0, purpose=Purpose.REQUEST)


@pytest.fixture
def queue() -> JobQueue:
    return JobQueue()


def test_without_jobs_nobody_is_chosen(queue: JobQueue) -> None:
    assert queue.choose(0.0) is None
    assert queue.next_at(0.0) == inf


def test_a_job_without_share_goes_before_one_with(queue: JobQueue) -> None:
    scan, change = Task(0.3), Task()
    queue.submit(scan, 0.0)
    queue.submit(change, 0.0)
    assert [queue.choose(0.0), queue.choose(0.0), queue.choose(0.0)] == [change, scan, None]


def test_a_job_keeps_to_its_share(queue: JobQueue) -> None:
    scan = Task(0.25)
    queue.submit(scan, 0.0)
    assert queue.choose(0.0) is scan
    queue.spend(scan, 0.5 + JOB_CREDIT, 0.5)
    queue.resume(scan)
    assert queue.choose(0.6) is None
    assert queue.next_at(0.5) == pytest.approx(2.5)
    assert queue.choose(2.5) is scan


def test_a_job_without_share_is_charged_nothing(queue: JobQueue) -> None:
    change = Task()
    queue.submit(change, 0.0)
    queue.spend(change, 9.0, 0.0)
    assert queue.choose(0.0) is change


def test_jobs_take_turns_but_a_poll_goes_on_at_once(queue: JobQueue) -> None:
    first, second, poll = Task(), Task(), a_poll(1)
    queue.submit(second, 0.0)
    queue.resume(first)
    queue.resume(poll)
    assert [queue.choose(0.0) for _ in range(3)] == [poll, second, first]


def test_a_slice_goes_on_before_all_others_and_whatever_the_share() -> None:
    queue, scan, change = JobQueue(), Task(0.1), Task()
    queue.submit(change, 0.0)
    queue.submit(scan, 0.0)
    queue.spend(scan, 5.0, 0.0)
    queue.continue_slice(scan)
    assert queue.choose(0.0) is scan
    assert queue.choose(0.0) is change


def test_a_requested_poll_waits_while_its_slave_id_is_a_jobs(queue: JobQueue) -> None:
    change, poll, other = Task(excludes=frozenset({1, 2})), a_poll(1), a_poll(3)
    queue.submit(change, 0.0)
    queue.submit(poll, 0.0)
    queue.submit(other, 0.0)
    assert queue.excluded == {1, 2}
    assert [queue.choose(0.0) for _ in range(3)] == [change, other, None]
    assert queue.next_at(0.0) == inf
    queue.over(change)
    assert queue.excluded == NONE
    assert queue.choose(0.0) is poll


def test_a_slave_id_is_free_when_the_last_job_that_wants_it_is_over(queue: JobQueue) -> None:
    one, other = Task(excludes=frozenset({1})), Task(excludes=frozenset({1, 2}))
    queue.submit(one, 0.0)
    queue.submit(other, 0.0)
    queue.over(other)
    assert queue.excluded == {1}


def test_a_job_rests_until_its_time_or_until_it_is_woken(queue: JobQueue) -> None:
    timed, asleep = Task(), Task()
    queue.hold(timed, Hold(3.0))
    queue.hold(asleep, Hold())
    assert queue.next_at(0.0) == 3.0
    assert queue.released(2.9) == []
    assert queue.released(3.0) == [timed]
    assert not queue.wake(timed)
    assert queue.wake(asleep)
    assert queue.next_at(0.0) == inf


def test_it_is_idle_where_no_job_waits_and_no_rest_is_over(queue: JobQueue) -> None:
    asleep, resting, waiting = Task(), Task(), Task()
    seen = [queue.idle(0.0)]
    queue.hold(asleep, Hold())
    queue.hold(resting, Hold(3.0))
    seen += [queue.idle(2.9), queue.idle(3.0)]
    queue.wake(resting)
    seen.append(queue.idle(3.0))
    queue.submit(waiting, 0.0)
    seen.append(queue.idle(3.0))
    assert seen == [True, True, False, True, False]


def test_a_poll_that_rests_is_late(queue: JobQueue) -> None:
    queue.hold(a_poll(1), Hold(3.0))
    assert not queue.idle(0.0)


def test_what_is_dropped_is_forgotten_wherever_it_waits(queue: JobQueue) -> None:
    waiting, resting, kept = Task(excludes=frozenset({1})), Task(0.5), Task()
    for job in (waiting, resting, kept):
        queue.submit(job, 0.0)
    assert queue.choose(0.0) is waiting
    queue.resume(waiting)
    assert queue.choose(0.0) is kept
    queue.resume(kept)
    queue.drop(lambda job: job is resting)
    queue.hold(resting, Hold(1.0))
    assert queue.drop(lambda job: job is not kept) == [waiting, resting]
    assert queue.excluded == NONE
    assert queue.released(5.0) == []
    assert queue.choose(0.0) is kept


def test_a_job_with_an_account_is_charged_there_and_keeps_to_it(queue: JobQueue) -> None:
    account = Quota(0.5, credit=0.0, now=0.0)
    probe = Task(0.9)
    queue.submit(probe, 0.0, account)
    assert queue.choose(0.0) is probe
    queue.spend(probe, 1.0, 0.0)
    queue.resume(probe)
    assert not account.allows(1.9)
    assert queue.choose(1.9) is None
    assert queue.choose(2.0) is probe
