"""Faults of a simulated sensor, and which of its replies a master may believe."""

from __future__ import annotations

from lfs10d.simulator.faults import FaultKind, SensorFault, sensor_fault
from lfs10d.simulator.sensor import Reply, Sensor


def add_fault(
    sensor: Sensor, kind: FaultKind | str, rate: float = 1.0, **particulars: float | str | tuple[str, ...] | None
) -> SensorFault:
    """Add a fault with times in seconds (see `sensor_fault`) and return it."""
    added = sensor_fault(kind, rate, **particulars)  # type: ignore[arg-type]  # passed on as they are
    sensor.faults.append(added)
    return added


def believable(reply: Reply) -> bool:
    """Whether every byte of a reply came onto the line as a well sensor sends it."""
    return reply.whole and not reply.burst.struck


def power_cycle(sensor: Sensor) -> None:
    """Switch a sensor's power off and on."""
    sensor.power_cut()
    sensor.power_up()
