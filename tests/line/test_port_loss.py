"""The port is lost and back: told once per reason, one reading per device, then all are due at once."""

from __future__ import annotations

from itertools import pairwise

import pytest

from lfs10d.modbus.bus import LineRules
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.reading import FaultCode
from tests.support.faulty_sensors import add_fault
from tests.support.lines import Rig, Rigs


def without_port(rig: Rig, since: float, until: float) -> None:
    rig.run(since)
    rig.port.unplug()
    rig.run(until)
    rig.port.replug()


def test_each_device_has_one_reading_of_the_loss_and_is_due_at_once_afterwards(rigs: Rigs) -> None:
    rig = rigs(4, interval=10.0)
    without_port(rig, 5.0, 65.0)
    rig.run(67.0).prove()
    for slave in range(1, 5):
        codes = [reading.fault.code if reading.fault else None for reading in rig.of(slave, since=5.0)]
        assert codes == [FaultCode.PORT_LOST, None]
        assert not rig.of(slave, since=5.0)[0].online
        assert rig.of(slave)[-1].at < 66.5


def test_it_is_told_once_per_reason(rigs: Rigs) -> None:
    rig = rigs(1)
    without_port(rig, 5.0, 20.0)
    rig.port.locked = True
    rig.run(30.0)
    rig.port.locked = False
    rig.run(40.0).prove()
    told = [change.fault.code if change.fault else None for change in rig.port_changes]
    assert told == [None, FaultCode.PORT_LOST, FaultCode.PORT_BUSY, None]
    assert rig.codes(1) == {FaultCode.PORT_LOST: 1}


def test_it_is_opened_again_after_a_fifth_of_a_second_and_then_every_second(rigs: Rigs) -> None:
    rig = rigs(1)
    rig.port.unplug()
    tries: list[float] = []
    opening = rig.port.open
    rig.port.open = lambda: (tries.append(rig.clock.now), opening())[1]  # type: ignore[func-returns-value, method-assign]  # counts, then opens as before
    rig.run(6.0)
    assert [later - earlier for earlier, later in pairwise(tries)] == pytest.approx([0.2, 0.4, 0.8, 1.0, 1.0, 1.0, 1.0])


def test_a_port_that_is_absent_at_the_start_is_a_lost_port(rigs: Rigs) -> None:
    rig = rigs(2)
    rig.port.unplug()
    rig.run(3.0)
    assert [reading.fault.code for reading in rig.readings if reading.fault] == [FaultCode.PORT_LOST] * 2
    rig.port.replug()
    rig.run(6.0).prove()
    assert rig.good(1)


def test_an_answer_to_a_request_from_before_the_loss_is_never_believed(rigs: Rigs) -> None:
    rig = rigs(1, response_timeout=0.5)
    rig.run(2.0)
    add_fault(rig.line.sensor(1), "late", delay=0.45)
    for n in range(40):
        rig.run(3.0 + n + n * 0.0131)
        rig.port.hang_up()
    rig.run(60.0).prove()


def test_other_settings_hold_from_the_next_exchange_and_another_path_is_opened(rigs: Rigs) -> None:
    rig = rigs(2, interval=0.25).run(5.0)
    rig.poller.reconfigure(PortSettings("/dev/simulated", 9600), LineRules(extra_gap=0.02))
    rig.run(10.0)
    assert min(exchange.gap or 0.0 for exchange in rig.exchanges if exchange.at > 5.1) >= 0.0236
    for sensor in rig.line.sensors:
        sensor.format = type(sensor.format)(19200)
    rig.poller.reconfigure(PortSettings("/dev/simulated", 19200), LineRules())
    rig.run(20.0)
    assert not rig.codes(1, since=12.0)
    assert len(rig.good(1, since=12.0)) >= 31
    rig.poller.reconfigure(PortSettings("/dev/other", 19200), LineRules())
    rig.run(25.0).prove()
    assert rig.port.settings.path == "/dev/other"
    assert rig.port.openings == 2
    assert rig.good(1, since=21.0)


def test_settings_can_change_while_the_port_is_lost(rigs: Rigs) -> None:
    rig = rigs(1, interval=0.25)
    without_port(rig, 5.0, 7.5)
    rig.port.unplug()
    rig.poller.reconfigure(PortSettings("/dev/other", 19200), LineRules(echo="off"))
    rig.run(9.0)
    rig.line.sensor(1).format = type(rig.line.sensor(1).format)(19200)
    rig.port.replug()
    rig.run(15.0).prove()
    assert rig.port.settings == PortSettings("/dev/other", 19200)
    assert rig.good(1, since=11.0)
