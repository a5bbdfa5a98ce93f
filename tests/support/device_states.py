"""One device's state, fed with readings at times; what it publishes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import cast

from lfs10d.reading import Fault, FaultCode, Reading
from lfs10d.system.clock import Instant
from lfs10d.telemetry.device_state import DeviceState
from lfs10d.telemetry.publication import Publication
from tests.support.stations import ONE_VALUE

FACTS = replace(ONE_VALUE, slave=3, label="Mast", interval=0.25)
TIMEOUT = Fault(FaultCode.TIMEOUT, "no answer in 200 ms")
REFUSED = Fault(FaultCode.EXCEPTION, "illegal data", exception_code=3)


def instant(mono: float) -> Instant:
    return Instant(mono, 1_795_298_000 + mono, "synced")


class Watched:
    """A device and its clock: `poll` hands it a reading at a time in s and returns the leaves published."""

    def __init__(self, *, seq: int = 0) -> None:
        self.device = DeviceState(FACTS, line="line0", boot="k3f9a2c7", seq=seq, now=instant(0))

    def publish(
        self, at: float, outcome: float | Fault, *, online: bool | None = None, masked: bool = False
    ) -> list[Publication]:
        fault = outcome if isinstance(outcome, Fault) else None
        reading = Reading(
            device="a",
            at=at,
            values=None if isinstance(outcome, Fault) else {"wind_speed": outcome},
            fault=fault,
            rtt=0.01823 if fault is None else None,
            online=fault is None if online is None else online,
            response_timeout=0.2,
        )
        return self.device.on_reading(reading, instant(at), masked=masked)[0]

    def poll(self, at: float, outcome: float | Fault, *, online: bool | None = None, masked: bool = False) -> list[str]:
        return leaves(self.publish(at, outcome, online=online, masked=masked))

    @property
    def shown(self) -> dict[str, object]:
        """Every retained payload now, by leaf."""
        return {each.topic.split("/")[-1]: each.payload for each in self.device.burst(instant(1e6))}


def leaves(published: Iterable[Publication]) -> list[str]:
    return [each.topic.removeprefix("device/a/") for each in published]


def fields(payload: object, *keys: str) -> tuple[object, ...]:
    return tuple(cast("Mapping[str, object]", payload)[key] for key in keys)
