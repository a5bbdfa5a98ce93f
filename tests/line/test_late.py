"""A late answer is never taken for the next."""

from __future__ import annotations

import pytest

from lfs10d.profiles.profile import Profile
from lfs10d.reading import FaultCode
from tests.support.faulty_sensors import add_fault
from tests.support.lines import Rigs


@pytest.mark.parametrize("in_turn", [True, False], ids=["in turn", "out of turn"])
@pytest.mark.parametrize("fixed", [0.5, None], ids=["fixed", "learned"])
@pytest.mark.parametrize("sensors", [1, 2, 8])
def test_answers_50_ms_after_500_ms_are_never_published(
    rigs: Rigs, sensors: int, fixed: float | None, *, in_turn: bool
) -> None:
    rig = rigs(sensors, response_timeout=fixed, in_turn=in_turn)
    for sensor in rig.line.sensors:
        add_fault(sensor, "late", 0.05, delay=0.55)
    rig.run(120.0).prove()
    late = sum(exchange.late for exchange in rig.exchanges)
    assert late > (3 if fixed else 0) or (not in_turn and not fixed)
    assert all(len(rig.good(sensor.slave)) > 100 for sensor in rig.line.sensors)


def test_the_time_out_learns_from_late_answers(rigs: Rigs) -> None:
    rig = rigs(1, interval=0.5)
    rig.run(10.0)
    assert rig.of(1)[-1].response_timeout == 0.05
    add_fault(rig.line.sensor(1), "late", delay=0.3)
    rig.run(60.0).prove()
    assert rig.of(1)[-1].response_timeout == pytest.approx(0.63, abs=0.01)
    assert not rig.codes(1, since=40.0)


def test_the_dead_of_whom_late_answers_come_to_others_are_told_as_late(rigs: Rigs) -> None:
    rig = rigs(12, response_timeout=0.1, in_turn=True)
    rig.run(2.0)
    add_fault(rig.line.sensor(1), "late", delay=0.25)
    rig.run(30.0).prove()
    assert sum(exchange.late for exchange in rig.exchanges if exchange.slave != 1) > 2
    assert len(rig.good(2)) > 60


def test_a_profile_without_barrier_waits_until_nothing_can_come(rigs: Rigs) -> None:
    text = rigs.spec(1).profile.model_dump(by_alias=True)
    plain = Profile.model_validate(text | {"barrier": None})
    rig = rigs(1, polled=[rigs.spec(1, 0.0, profile=plain, response_timeout=0.5)])
    add_fault(rig.line.sensor(1), "late", 0.05, delay=0.55)
    rig.run(60.0).prove()
    assert len(rig.good(1)) > 500
    for earlier, later in zip(rig.exchanges, rig.exchanges[1:], strict=False):
        if earlier.fault is FaultCode.TIMEOUT:
            assert later.began is not None
            assert earlier.began is not None
            assert later.began - earlier.began >= 1.0


def test_a_slave_that_refuses_everything_is_told_from_one_that_answers_late(rigs: Rigs) -> None:
    rig = rigs(1, interval=0.25, response_timeout=0.2, in_turn=True)
    add_fault(rig.line.sensor(1), "exception")
    add_fault(rig.line.sensor(1), "late", 0.2, delay=0.25)
    rig.run(60.0).prove()
    assert rig.codes(1)[FaultCode.EXCEPTION] > 50
    rig.line.sensor(1).faults.clear()
    rig.run(70.0).prove()
    assert len(rig.good(1, since=63.0)) > 25
