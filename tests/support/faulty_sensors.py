"""Faults of a simulated sensor, and which of its replies a master may believe."""

from __future__ import annotations

from dataclasses import replace

from lfs10d.simulator.faults import DEFAULT_DELAYS, FaultKind, SensorFault, window
from lfs10d.simulator.sensor import Reply, Sensor
from lfs10d.simulator.wire import nanoseconds


def sensor_fault(
    kind: FaultKind | str,
    rate: float = 1.0,
    *,
    delay: float | None = None,
    first: float = 0.0,
    last: float | None = None,
    every: float | None = None,
    **particulars: int | str | tuple[str, ...] | None,
) -> SensorFault:
    """Return a fault with times in seconds; `particulars` are code, value, length, answer, reads and values.

    Raises ValueError for an unknown kind, TypeError for an unknown particular.
    """
    kind = FaultKind(kind)
    seconds = DEFAULT_DELAYS.get(kind, 0.0) if delay is None else delay
    plain = SensorFault(kind, rate, window(first, last, every), nanoseconds(seconds))
    return replace(plain, **particulars)  # type: ignore[arg-type]  # replace checks the names, the kinds use them


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
