"""Ails of simulated sensors, as stories of a line give them."""

from __future__ import annotations

from typing import Any, TypeAlias

from lfs10d.simulator.faults import FaultKind
from lfs10d.simulator.sensor import Sensor
from tests.support.faulty_sensors import add_fault

Ail: TypeAlias = tuple[str, dict[str, Any]]
"""A fault of a sensor and its particulars; "none" is well."""
NO_AIL: Ail = ("none", {})


def ail(sensor: Sensor, *ails: Ail) -> None:
    """Give a sensor these faults."""
    for kind, particulars in ails:
        if kind != "none":
            add_fault(sensor, kind, **particulars)


def has_a_twin(sensor: Sensor) -> bool:
    """Whether another sensor of its id, of the simulator's kind, answers all its requests too."""
    return any(fault.kind is FaultKind.TWIN and fault.rate == 1.0 for fault in sensor.faults)
