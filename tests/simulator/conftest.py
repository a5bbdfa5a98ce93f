"""A simulated line with a plain master on it, in virtual time."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from lfs10d.modbus.port_settings import PortSettings
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Framing
from tests.support.simulated import Bench
from tests.support.virtual_port import SimulatedPort, VirtualClock


@pytest.fixture
def bench() -> Callable[..., Bench]:
    """Return a maker of benches with the sensors given to it."""

    def make(
        *sensors: Sensor, baudrate: int = 9600, framing: Framing = "rtu", latency: float = 0.0, echo: bool = False
    ) -> Bench:
        line = SimulatedLine(sensors, framing=framing)
        clock = VirtualClock(1.0)
        port = SimulatedPort(line, clock, PortSettings("sim", baudrate=baudrate), latency=latency, echo=echo)
        port.open()
        return Bench(line, port, clock, framing)

    return make
