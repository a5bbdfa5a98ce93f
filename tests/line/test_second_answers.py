"""A second answer to one request is never taken for the next one's; nor is what a gateway's target says late."""

from __future__ import annotations

import itertools

import pytest

from lfs10d.line.device import PollRules
from lfs10d.line.second_answers import SecondAnswers
from lfs10d.line.unproved_answers import PROVED_WITHIN
from lfs10d.modbus.outcome import LateAnswer
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import AnsweredTwice, FaultCode
from lfs10d.simulator.line_faults import second_master
from tests.support.faulty_sensors import add_fault
from tests.support.lines import LFS10, Rig, Rigs
from tests.support.outcomes import ended

WIND_OF_2 = bytes((2, 3, 0, 1, 0, 2))


def told(rig: Rig) -> list[AnsweredTwice]:
    return [event for event in rig.events if isinstance(event, AnsweredTwice)]


@pytest.mark.parametrize("kind", ["twin", "repeated"])
@pytest.mark.parametrize("delay", [0.005, 0.012, 0.037, 0.06, 0.1])
@pytest.mark.parametrize(("slaves", "interval"), [(1, 0.0), (1, 0.5)])
@pytest.mark.parametrize("turnaround", [0.005, 0.04])
def test_a_late_twin_or_a_repeater_is_told_and_yields_no_value(
    rigs: Rigs, kind: str, delay: float, slaves: int, interval: float, turnaround: float
) -> None:
    rig = rigs(slaves, turnaround=turnaround, interval=interval)
    add_fault(rig.line.sensor(1), kind, delay=delay)
    rig.run(15.0).prove()
    twice = told(rig)[0]
    assert (twice.device, twice.slave) == ("slave-1", 1)
    assert twice.fault is not None
    assert twice.fault.code is FaultCode.DUPLICATE_ID
    assert twice.at < 1.5
    assert len(rig.good(1)) > 25
    asked = [each for each in rig.exchanges if each.slave == 1 and each.at > twice.at and each.began is not None]
    for earlier, later in itertools.pairwise(asked):
        assert later.began is not None
        assert later.began - earlier.at > delay


def await_requests(rig: Rig, count: int) -> None:
    """Let the line carry so many more requests."""
    wanted = rig.sent + count
    while rig.sent < wanted:
        rig.run(rig.clock.now + 0.05)


@pytest.mark.parametrize(("kind", "delay"), [("twin", 0.037), ("repeated", 0.037), ("twin", 0.045)])
@pytest.mark.parametrize("seed", [0, 5, 9, 18])
def test_not_even_the_first_second_answer_is_believed_that_comes_when_the_next_answer_is_due(
    rigs: Rigs, kind: str, delay: float, seed: int
) -> None:
    """Four sensors are asked every 40 ms, which answer after 5 to 8 ms; the time alone tells nothing."""
    rules = PollRules(retries=0, offline_after=100)
    rig = rigs(4, rules=rules, baudrate=115200, jitter=0.003, seed=seed, in_turn=True)
    await_requests(rig, 100)
    for slave in (2, 3):
        add_fault(rig.line.sensor(slave), kind, 0.3, delay=delay)
    await_requests(rig, 120)
    rig.prove()
    assert {event.slave for event in told(rig)} <= {2, 3}
    assert all(len(rig.good(slave)) > 20 for slave in (1, 2, 3, 4))
    for slave in (1, 2, 3, 4):
        readings = rig.of(slave)
        assert all(earlier.at <= later.at for earlier, later in itertools.pairwise(readings))


@pytest.mark.parametrize("kind", ["twin", "repeated"])
def test_it_is_over_when_no_second_answer_comes_any_more(rigs: Rigs, kind: str) -> None:
    rig = rigs(1, interval=0.25)
    add_fault(rig.line.sensor(1), kind)
    rig.run(5.0)
    rig.line.sensor(1).faults.clear()
    rig.run(20.0).prove()
    begun, over = told(rig)
    assert begun.fault is not None
    assert over.fault is None
    assert 12.0 < over.at < 14.0


def test_a_well_line_is_asked_as_often_as_before_but_once_after_the_first_answer(rigs: Rigs) -> None:
    rig = rigs(1).run(10.0).prove()
    assert told(rig) == []
    pauses = [
        later.began - earlier.at
        for earlier, later in zip(rig.exchanges, rig.exchanges[1:], strict=False)
        if later.began
    ]
    assert sum(pause > 0.01 for pause in pauses) == 1


def test_a_sensor_that_is_late_is_no_second_one(rigs: Rigs) -> None:
    rig = rigs(2, interval=0.25, in_turn=True)
    add_fault(rig.line.sensor(1), "late", 0.2, delay=0.4)
    rig.run(60.0).prove()
    assert told(rig) == []


@pytest.mark.parametrize("code", [5, 10, 11])
@pytest.mark.parametrize("interval", [0.0, 0.25, 1.0])
@pytest.mark.parametrize("delay", [0.05, 0.1, 0.6])
def test_what_a_gateways_target_says_after_an_exception_is_never_the_next_answer(
    rigs: Rigs, code: int, interval: float, delay: float
) -> None:
    rig = rigs(2, interval=interval, in_turn=True)
    add_fault(rig.line.sensor(1), "gateway", 0.1, code=code, delay=delay)
    rig.run(40.0).prove()
    assert rig.codes(1)[FaultCode.EXCEPTION] > 0
    assert rig.codes(1).keys() <= {
        FaultCode.EXCEPTION,
        FaultCode.LATE,
        FaultCode.CRC,
        FaultCode.MALFORMED,
        FaultCode.TIMEOUT,
        FaultCode.COLLISION,
    }
    assert len(rig.good(1)) > 20
    assert told(rig) == []


def test_a_gateway_that_always_refuses_is_asked_once_per_poll(rigs: Rigs) -> None:
    rig = rigs(1, interval=0.25)
    add_fault(rig.line.sensor(1), "exception", code=11)
    rig.run(10.0).prove()
    assert rig.codes(1) == {FaultCode.EXCEPTION: len(rig.of(1))}
    assert len(rig.exchanges) == len(rig.of(1)) >= 35
    rig.line.sensor(1).faults.clear()
    rig.run(15.0).prove()
    assert len(rig.good(1, since=11.5)) > 12


@pytest.mark.parametrize("interval", [0.0, 0.25])
@pytest.mark.parametrize(("turnaround", "every"), [(0.005, 0.37), (0.03, 0.37), (0.03, 0.137)])
def test_what_a_second_master_is_answered_is_never_ours(
    rigs: Rigs, interval: float, turnaround: float, every: float
) -> None:
    rig = rigs(3, interval=interval, turnaround=turnaround, in_turn=True)
    second_master(rig.line, WIND_OF_2, 1.0, every)
    rig.run(30.0).prove()
    assert told(rig) == []
    # Every 137 ms hardly a moment is free for both: ours waits for the pause, rather than collide.
    assert len(rig.good(2)) > (60 if every < 0.2 else 100)


@pytest.mark.parametrize("interval", [0.0, 0.25])
def test_a_slave_that_another_master_asks_seven_times_a_second_still_has_values(rigs: Rigs, interval: float) -> None:
    rig = rigs(3, interval=interval, turnaround=0.03, in_turn=True)
    second_master(rig.line, WIND_OF_2, 1.0, 0.137)
    rig.run(30.0).prove()
    assert len(rig.good(2, since=5.0)) > 50
    assert all(reading.online for reading in rig.of(2, since=5.0))


@pytest.mark.parametrize("kind", ["twin", "repeated"])
@pytest.mark.parametrize(
    ("slaves", "interval", "turnaround", "delay", "told_after"),
    [
        (1, 0.0, 0.005, 0.02, 7.0),
        (1, 0.0, 0.04, 0.1, 7.0),
        (2, 0.0, 0.02, 0.06, 5.0),
        (3, 0.0, 0.005, 0.02, 5.0),
        (3, 0.0, 0.04, 0.005, 5.0),
        (4, 0.5, 0.005, 0.037, 5.0),
        (8, 0.0, 0.02, 0.037, 5.0),
        (8, 1.0, 0.02, 0.012, 6.0),
    ],
)
def test_one_that_appears_on_a_running_line_is_told_whomever_it_meets(
    rigs: Rigs, kind: str, slaves: int, interval: float, turnaround: float, delay: float, told_after: float
) -> None:
    rig = rigs(slaves, turnaround=turnaround, interval=interval)
    add_fault(rig.line.sensor(1), kind, delay=delay, first=5.013)
    rig.run(15.0).prove()
    twice = told(rig)[0]
    assert (twice.slave, len(told(rig))) == (1, 1)
    assert 5.0 < twice.at < 5.0 + told_after
    for slave in range(1, slaves + 1):  # from then on the neighbours are heard again
        late = rig.of(slave, since=twice.at + 2.0)
        assert len(rig.good(slave, since=twice.at + 2.0)) >= 0.9 * len(late)


def test_what_is_asked_of_a_slave_that_nobody_polls_is_never_doubted() -> None:
    answers = SecondAnswers(PendingRequests())
    request = ReadRegisters(9, 1, 2)
    outcome = ended(request, answer=(1, 2), heard=b"x", late=(LateAnswer(request, 0.3),))
    assert answers.is_doubtful(outcome, 0.1) is False
    assert answers.prove(outcome, []) == []


@pytest.mark.parametrize("barrier", [True, False])
def test_where_times_tell_nothing_one_alone_is_asked_something_else_or_left_alone_now_and_then(
    rigs: Rigs, *, barrier: bool
) -> None:
    """It is asked without a pause, and takes 5 to 55 ms: a second answer would look like any other."""
    profile = LFS10 if barrier else LFS10.model_copy(update={"barrier": None})
    rig = rigs(1, polled=[rigs.spec(1, 0.0, profile=profile)], jitter=0.05, in_turn=True)
    seen = longest = 0.0
    for n in range(1, 3000):
        rig.run(0.01 * n)
        for reading in rig.readings[int(seen) :]:
            longest = max(longest, rig.clock.now - reading.at)
        seen = len(rig.readings)
    rig.prove()
    assert not rig.codes(1)
    assert len(rig.good(1)) > (450 if barrier else 180)
    assert longest < PROVED_WITHIN + 0.3
    asked = {exchange.sent[3] for exchange in rig.exchanges if exchange.at > 1.0}
    assert asked == ({1, 5} if barrier else {1})
