"""The line is used to its limit, evenly, on grids that do not drift."""

from __future__ import annotations

import pytest

from lfs10d.line.device import PollRules
from lfs10d.modbus.timing import LineTiming
from tests.support.faulty_sensors import add_fault
from tests.support.lines import Rigs


@pytest.mark.parametrize("baudrate", [9600, 19200])
@pytest.mark.parametrize("echo", [False, True])
def test_the_line_is_used_to_its_limit(rigs: Rigs, baudrate: int, *, echo: bool) -> None:
    rig = rigs(32, baudrate=baudrate, turnaround=0.0055, echo=echo).run(20.0).prove()
    limit = 20.0 / LineTiming.of(baudrate).exchange(8, 9, 0.0055)
    assert len(rig.readings) >= 0.99 * limit


def test_an_adapter_of_16_ms_costs_the_rest_of_its_slice_and_no_more(rigs: Rigs) -> None:
    rig = rigs(32, latency=0.016).run(20.0).prove()
    assert len(rig.readings) >= 0.99 * 20.0 / 0.032


@pytest.mark.parametrize("sensors", [1, 8, 32])
def test_two_percent_of_faults_leave_94_percent_of_the_rate(rigs: Rigs, sensors: int) -> None:
    sound = rigs(sensors).run(60.0)
    rig = rigs(sensors)
    for sensor in rig.line.sensors:
        add_fault(sensor, "noisy", 0.01)
        add_fault(sensor, "truncated", 0.005)
        add_fault(sensor, "garbage", 0.005)
    rig.run(60.0).prove()
    good = sum(reading.fault is None for reading in rig.readings)
    assert good >= 0.94 * len(sound.readings)


def test_a_day_of_polling_does_not_drift(rigs: Rigs) -> None:
    specs = [rigs.spec(1, 30.0), rigs.spec(2, 60.1), rigs.spec(3, 86400.0)]
    rig = rigs(3, polled=specs, started=1e6).run(1e6 + 86400.0 + 1.0)
    for slave, interval in ((1, 30.0), (2, 60.1)):
        times = [reading.at for reading in rig.of(slave)]
        assert len(times) == 86401 // interval + 1
        assert times[-1] - times[0] == pytest.approx(interval * (len(times) - 1), abs=0.01)
        assert not any(reading.overruns for reading in rig.of(slave))
    assert len(rig.of(3)) == 2


def test_overload_degrades_evenly_and_is_counted(rigs: Rigs) -> None:
    rig = rigs(32, interval=0.25).run(60.0).prove()
    counts = [len(rig.of(slave)) for slave in range(1, 33)]
    assert max(counts) - min(counts) <= 2
    told = [len(rig.of(slave)) + sum(reading.overruns for reading in rig.of(slave)) for slave in range(1, 33)]
    assert told == pytest.approx([240] * 32, abs=4)


def test_each_slave_has_its_own_interval_and_interval_0_takes_the_rest_in_turn(rigs: Rigs) -> None:
    specs = [rigs.spec(1, 0.25), rigs.spec(2, 1.0), rigs.spec(3, 0.0), rigs.spec(4, 0.0)]
    rig = rigs(4, polled=specs).run(60.0).prove()
    assert len(rig.of(1)) == pytest.approx(240, abs=1)
    assert len(rig.of(2)) == pytest.approx(60, abs=1)
    assert abs(len(rig.of(3)) - len(rig.of(4))) <= 2
    assert len(rig.readings) >= 0.98 * 60.0 / LineTiming.of(9600).exchange(8, 9, 0.005)


def test_retries_go_behind_those_that_were_due(rigs: Rigs) -> None:
    rig = rigs(4, interval=0.12, rules=PollRules(retries=3)).run(5.0)
    add_fault(rig.line.sensor(1), "noisy")
    rig.run(20.0).prove()
    for slave in (2, 3, 4):
        missed = sum(reading.overruns for reading in rig.of(slave))
        assert len(rig.of(slave)) + missed == pytest.approx(20.0 / 0.12, abs=3)
        assert len(rig.of(slave)) >= 0.7 * 20.0 / 0.12


def test_with_nobody_to_poll_the_line_rests(rigs: Rigs) -> None:
    rig = rigs(2, polled=[]).run(100.0)
    assert rig.sent == 0
    assert rig.turns <= 5
