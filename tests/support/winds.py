"""Devices that measure wind, and readings of them, in virtual time: for the tests of wind statistics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import cast

from lfs10d.reading import Reading
from lfs10d.system.clock import Instant
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry.info import DeviceInfo, WindInfo, WindValues
from lfs10d.telemetry.publication import Publication
from lfs10d.telemetry.wind.station import WindStation
from tests.support.stations import ONE_VALUE, TIMEOUT, failed

ANEMOMETER = replace(ONE_VALUE, wind=WindInfo(WindValues("wind_speed", None, "m/s"), every=10.0, records=600.0))
"""Device a."""
VANE = replace(
    ONE_VALUE,
    name="v",
    profile="vane",
    value_names=("wind_direction",),
    units={"wind_direction": "°"},
    wind=WindInfo(WindValues(None, "wind_direction", None), every=10.0, records=600.0),
)
SONIC = replace(
    ONE_VALUE,
    name="s",
    profile="sonic",
    value_names=("wind_speed", "wind_direction"),
    units={"wind_speed": "m/s", "wind_direction": "°"},
    wind=WindInfo(WindValues("wind_speed", "wind_direction", "m/s"), every=10.0, records=600.0),
)
TEN_MINUTES = 600_000
MIDNIGHT = 1_795_305_600.0
"""Epoch s of a full hour."""


def reading(device: str, at: float, **values: float) -> Reading:
    return Reading(device, at, values, None, 0.02, online=True, response_timeout=0.2)


def silence(device: str, at: float) -> Reading:
    return failed(device, at, TIMEOUT)


@dataclass
class Weather:
    """A station of winds in virtual time: `shift` is the wall clock less the monotonic one, in s."""

    station: WindStation
    shift: float
    clock: ClockState = "synced"
    published: list[Publication] = field(default_factory=list)
    now: float = 0.0

    def instant(self, at: float) -> Instant:
        return Instant(at, at + self.shift, self.clock)

    def run(
        self, until: float, speed: Callable[[float], float] | None = None, *, every: float = 1.0, device: str = "a"
    ) -> None:
        """Let time pass, with good readings of `speed` at each multiple of `every`; None: with none."""
        count = round(self.now / every) + 1
        while count * every <= until:
            at = count * every
            self._until(at)
            if speed is not None:
                self.station.on_reading(reading(device, at, wind_speed=speed(at)), self.instant(at))
            self._until(at)
            count += 1
        self._until(until)

    def _until(self, at: float) -> None:
        while self.station.due <= at:
            self.now = max(self.station.due, self.now)
            self.published += self.station.tick(self.instant(self.now))
        self.now = max(at, self.now)

    def newest(self, leaf: str) -> dict[str, object]:
        """Return the newest payload on a topic."""
        return self.all(leaf)[-1]

    def all(self, leaf: str) -> list[dict[str, object]]:
        """Return all payloads on a topic."""
        payloads = (each.payload for each in self.published if each.topic.endswith(f"/{leaf}"))
        return [cast("dict[str, object]", payload) for payload in payloads]


def weather(*devices: DeviceInfo, wall: float = MIDNIGHT) -> Weather:
    """Return a station that begins at `wall` and the monotonic time 0."""
    now = Instant(0.0, wall, "synced")
    return Weather(WindStation("line0", "k3f9a2c7", devices or (ANEMOMETER,), now), wall)
