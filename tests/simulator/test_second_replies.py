"""Faults by which more than one reply comes to one request: a twin, a repeater, a gateway."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from lfs10d.simulator.sensor import Reply, Sensor
from lfs10d.simulator.wire import Format, nanoseconds
from tests.support.faulty_sensors import add_fault, believable
from tests.support.queued_sensor import QueuedSensor
from tests.support.simulated import Bench

Maker = Callable[..., Bench]
WRITE_ID = bytes((1, 6, 0, 5, 0, 1))
READ = bytes((1, 3, 0, 1, 0, 2))


def answers(bench: Maker, kind: str, **particulars: float) -> list[Reply]:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), kind, **particulars)
    line.read(1, wait=0.4)
    return line.line.log[0].answers


def apart(first: Reply, second: Reply) -> int:
    return second.burst.start - first.burst.ends[-1]


@pytest.mark.parametrize(("particulars", "delay"), [({}, 0.037), ({"delay": 0.012}, 0.012)])
def test_a_twin_answers_with_a_value_of_its_own_after_the_first(
    bench: Maker, particulars: dict[str, float], delay: float
) -> None:
    first, second = answers(bench, "twin", **particulars)
    assert (first.second, second.second) == (False, True)
    assert apart(first, second) == nanoseconds(delay)
    assert believable(first)
    assert believable(second)
    assert first.values != second.values
    assert len(second.values) == 1


@pytest.mark.parametrize(("particulars", "delay"), [({}, 0.037), ({"delay": 0.1}, 0.1)])
def test_a_repeater_sends_the_same_bits_again(bench: Maker, particulars: dict[str, float], delay: float) -> None:
    first, second = answers(bench, "repeated", **particulars)
    assert (first.second, second.second) == (False, True)
    assert apart(first, second) == nanoseconds(delay)
    assert bytes(second.burst.data) == bytes(first.burst.data)
    assert second.values == ()  # the value is the first one's: whoever publishes it again is wrong


@pytest.mark.parametrize(
    ("particulars", "code", "delay"), [({}, 11, 0.1), ({"code": 5, "delay": 0.05}, 5, 0.05), ({"code": 10}, 10, 0.1)]
)
def test_a_gateway_refuses_at_once_and_its_target_answers_later(
    bench: Maker, particulars: dict[str, float], code: int, delay: float
) -> None:
    refusal, late = answers(bench, "gateway", **particulars)
    assert bytes(refusal.burst.data)[:3] == bytes((1, 0x83, code))
    assert refusal.values == ()
    assert apart(refusal, late) == nanoseconds(delay)
    assert believable(late)
    assert not late.second  # it is the first that answers with a value
    assert len(late.values) == 1


def test_a_write_is_answered_once_by_a_twin_and_twice_by_a_repeater() -> None:
    """Two sensors echo one write with the same bits at the same time."""
    for kind, following in (("twin", 0), ("repeated", 1)):
        sensor = Sensor(1)
        add_fault(sensor, kind)
        reply = sensor.hear(WRITE_ID, 0)
        assert reply is not None
        assert len(reply.following) == following


def test_what_follows_is_postponed_with_the_reply_and_later_replies_wait_for_the_sensors_own_only() -> None:
    sensor = QueuedSensor(1, turnaround=0.005)
    add_fault(sensor, "late", delay=0.3, last=1.0)
    add_fault(sensor, "twin", delay=0.2)
    first, second = sensor.hear(READ, 900_000_000), sensor.hear(READ, 1_100_000_000)
    assert first is not None
    assert second is not None
    assert second.start == first.ends + Format().t35
    assert second.following[0].start == second.ends + nanoseconds(0.2)


def test_a_queued_gateway_answers_the_next_request_after_its_targets_reply() -> None:
    sensor = QueuedSensor(1, turnaround=0.005)
    add_fault(sensor, "gateway", last=1.0)
    first, second = sensor.hear(READ, 900_000_000), sensor.hear(READ, 1_000_000_001)
    assert first is not None
    assert second is not None
    assert second.start == first.following[0].ends + Format().t35
