"""A line in virtual time into which a newcomer is plugged."""

from __future__ import annotations

from typing import Any

from lfs10d.command import Command, Result
from lfs10d.reconfiguration.adopt_request import AdoptRequest
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.lives import Bench, Life


def plugged(bench: Bench, baudrate: int = 9600, slave: int = 1) -> Sensor:
    return bench.line.add(Sensor(slave, format=Format(baudrate)))


def writes(bench: Bench) -> list[bytes]:
    return [request.body for request in bench.line.log if request.body[1:2] == b"\x06"]


def adopted(bench: Bench, life: Life, **wanted: Any) -> Result:  # noqa: ANN401 - as Newcomer
    return bench.ask(life, life.physical.adopt(AdoptRequest(**wanted), Command("n1")), within=300.0)
