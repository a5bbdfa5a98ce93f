"""A station with devices of one and of two values, and readings for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import cast

from lfs10d.reading import Fault, FaultCode, Reading
from lfs10d.system.clock import Instant
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry.info import DaemonInfo, DeviceInfo, LineInfo
from lfs10d.telemetry.publication import Payload, Publication
from lfs10d.telemetry.station import Station

WALL = 1_795_298_000.0
DAEMON = DaemonInfo("0.1", "gw", "k3f9a2c7", "k3f9a2c6", "abc", 0, {"version": "5"}, ("store",))
LINE = LineInfo("line0", "/dev/ttyUSB0", 9600, "none", 8, 1, "rtu", 0.0036458)
ONE_VALUE = DeviceInfo(
    name="a",
    slave=2,
    label=None,
    profile="lfs10",
    interval=1.0,
    enabled=True,
    response_timeout=None,
    value_names=("wind_speed",),
    units={"wind_speed": "m/s"},
    offline_after=2,
)
TWO_VALUES = replace(
    ONE_VALUE,
    name="b",
    slave=3,
    label="Fan",
    profile="fuling-dzb",
    value_names=("output_current", "speed"),
    units={"output_current": "A", "speed": "rpm"},
)
THIRD = replace(ONE_VALUE, name="c", slave=4)

TIMEOUT = Fault(FaultCode.TIMEOUT, "no answer in 200 ms")
LOST = Fault(FaultCode.PORT_LOST, "absent: plug it in")
LOCKED = Fault(FaultCode.PORT_BUSY, "locked by minicom")

LINE_TOPICS = {"info", "devices", "line/state", "line/error", "line/stats"}


def instant(mono: float, clock: ClockState = "synced") -> Instant:
    return Instant(mono, WALL + mono, clock)


def station(*devices: DeviceInfo) -> Station:
    return Station(DAEMON, LINE, devices or (ONE_VALUE, TWO_VALUES), instant(0))


def good(device: str, at: float) -> Reading:
    values = {"output_current": 1.5, "speed": 1450} if device == "b" else {"wind_speed": 12.34}
    return Reading(device, at, values, None, 0.02, online=True, response_timeout=0.2)


def failed(device: str, at: float, fault: Fault, *, online: bool = False, overruns: int = 0) -> Reading:
    return Reading(device, at, None, fault, None, online=online, response_timeout=0.2, overruns=overruns)


def topics(published: Iterable[Publication]) -> list[str]:
    return [each.topic for each in published]


def fields(payload: object, *keys: str) -> tuple[object, ...]:
    return tuple(cast("Mapping[str, object]", payload)[key] for key in keys)


def shown(of: Station, topic: str, at: float = 0) -> Payload:
    """Return what the next burst says on one topic."""
    (payload,) = [each.payload for each in of.burst(instant(at)) if each.topic == topic]
    return payload


def ail(of: Station, device: str = "a", *, since: float = 0) -> list[str]:
    """Let a device fail until its error has risen."""
    first = of.on_event(failed(device, since, TIMEOUT), instant(since))
    return topics(first + of.on_event(failed(device, since + 1, TIMEOUT), instant(since + 1)))
