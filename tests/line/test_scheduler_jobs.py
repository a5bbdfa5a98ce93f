"""Jobs beside polls: their class, their share of the time, the ids they exclude."""

from __future__ import annotations

import pytest

from lfs10d.line.jobs.job import Continue, Hold, Requeue
from lfs10d.line.scheduler import Rest, Scheduler
from lfs10d.reading import Purpose
from tests.support.schedules import T9600, TAKES, Rig, Task, asking, spec


def test_requests_go_before_polls_and_jobs_in_their_share_too() -> None:
    rig = Rig(spec(1, 0.0))
    rig.run(0.1)
    rig.scheduler.submit(Task(asking(7), share=0.3), rig.now)
    rig.scheduler.submit(Task(asking(8)), rig.now)
    rig.asked.clear()
    rig.run(rig.now + 0.1)
    assert rig.asked[:3] == [8, 7, 1]


def test_a_job_in_its_share_leaves_the_rest_to_the_polls() -> None:
    rig = Rig(spec(1, 0.0))
    words = [word for _ in range(1000) for word in (asking(7), Requeue(0.0))]
    rig.scheduler.submit(Task(*words, share=0.3), 0.0)
    rig.run(20.0)
    assert rig.asked.count(7) / len(rig.asked) == pytest.approx(0.3, abs=0.03)


def test_a_job_that_has_nothing_to_ask_is_over_and_its_slave_ids_are_free() -> None:
    rig = Rig(spec(1, 0.0))
    rig.scheduler.submit(Task(excludes=frozenset({1})), 0.0)
    rig.run(0.1)
    assert set(rig.asked) == {1}


def test_a_slice_of_a_job_is_not_interrupted() -> None:
    rig = Rig(spec(1, 0.0))
    rig.run(0.1)
    rig.scheduler.submit(Task(asking(7), Continue(), asking(8), Continue(), asking(9), share=0.1), rig.now)
    rig.asked.clear()
    rig.run(rig.now + 0.2)
    assert rig.asked[:4] == [7, 8, 9, 1]


def test_others_are_polled_while_a_job_rests_and_it_may_be_woken() -> None:
    rig = Rig(spec(1, 0.0))
    resting, asleep = Task(Hold(0.5), asking(7)), Task(Hold(), asking(8))
    rig.scheduler.submit(resting, 0.0)
    rig.scheduler.submit(asleep, 0.0)
    rig.run(0.4)
    assert set(rig.asked) == {1}
    rig.run(0.6)
    assert set(rig.asked) == {1, 7}
    rig.scheduler.wake(asleep, rig.now)
    rig.scheduler.wake(resting, rig.now)
    assert rig.ask() == asking(8)
    assert rig.scheduler.purpose is Purpose.SCAN


def test_a_slave_id_that_a_job_excludes_is_polled_by_nobody_else() -> None:
    rig = Rig(spec(1, 0.1), spec(2, 0.1))
    rig.scheduler.submit(Task(Hold(1.0), asking(1), excludes=frozenset({1})), 0.0)
    rig.run(0.99)
    assert set(rig.asked) == {2}
    rig.run(3.0)
    assert {1, 2} == set(rig.asked[-5:])


def test_a_line_without_devices_carries_out_jobs() -> None:
    rig = Rig()
    rig.scheduler = Scheduler(T9600, 0.0)
    rig.scheduler.submit(Task(asking(7)), 0.0)
    assert rig.run(1.0) == []
    assert rig.asked == [7]


def test_jobs_and_requested_polls_outlast_a_change_of_what_is_polled() -> None:
    rig = Rig(spec(1, 100.0), spec(2, 100.0))
    rig.run(1.0)
    rig.scheduler.submit(rig.poll_of("slave-1", 5), rig.now)
    rig.scheduler.submit(Task(asking(7)), rig.now)
    rig.replace(spec(1, 100.0))
    rig.asked.clear()
    assert [reading.requests for reading in rig.run(2.0)] == [(5,)]
    assert rig.asked == [1, 7]


def test_a_job_that_probes_has_the_share_of_probes_while_somebody_answers() -> None:
    rig = Rig(spec(1, 0.0))
    job = Task(*[word for _ in range(2000) for word in (asking(7), Requeue(0.0))], share=0.3)
    job.purpose = Purpose.PROBE
    rig.run(0.5)
    rig.scheduler.submit(job, rig.now)
    rig.run(100.0)
    assert rig.asked.count(7) / len(rig.asked) < 0.06


def test_the_line_rests_until_the_share_of_a_job_allows() -> None:
    rig = Rig()
    rig.scheduler.submit(Task(*[word for _ in range(9) for word in (asking(7), Requeue(0.0))], share=0.01), 0.0)
    while (ask := rig.ask()) is not None:
        rig.settle(ask)
    decision = rig.scheduler.next(rig.now)
    assert isinstance(decision, Rest)
    assert rig.now < decision.until < rig.now + 10.0
    rig.now = decision.until
    assert rig.ask() is not None


@pytest.mark.parametrize(("purpose", "share"), [(Purpose.SCAN, 0.3), (Purpose.CHANGE, 0.2)])
def test_a_change_pays_half_as_much_again_on_a_crowded_line(purpose: Purpose, share: float) -> None:
    rig = Rig(spec(1, 0.0))
    rig.run(0.5)
    job = Task(*[word for _ in range(1000) for word in (asking(7), Requeue(0.0))], share=0.3)
    job.purpose = purpose
    rig.scheduler.submit(job, rig.now)
    rig.asked.clear()
    rig.run(20.0)
    assert rig.asked.count(7) / len(rig.asked) == pytest.approx(share, abs=0.03)


def test_a_change_pays_nothing_for_others_where_there_are_none() -> None:
    rig = Rig()
    job = Task(*[word for _ in range(1000) for word in (asking(7), Requeue(0.0))], share=0.3)
    job.purpose = Purpose.CHANGE
    rig.scheduler.submit(job, 0.0)
    rig.run(20.0)
    assert len(rig.asked) * (TAKES + T9600.gap) / 20.0 == pytest.approx(0.3, abs=0.03)
