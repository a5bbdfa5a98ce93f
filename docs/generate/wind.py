"""Real payloads of the topics `wind` and `record`: an anemometer with a vane in a gusty wind for twelve minutes."""

from __future__ import annotations

from dataclasses import dataclass
from math import sin
from typing import Final

from docs.generate.examples import BEGUN, BOOT, LINE
from lfs10d.reading import Reading
from lfs10d.system.clock import Instant
from lfs10d.telemetry.info import DeviceInfo, WindInfo, WindValues
from lfs10d.telemetry.publication import RECORD, WIND, device_topic
from lfs10d.telemetry.wind.station import WindStation

SECONDS: Final = 1000
_MAST: Final = DeviceInfo(
    name="mast-top",
    slave=2,
    label="Mast, 10 m",
    profile="sonic",
    interval=1.0,
    enabled=True,
    response_timeout=None,
    value_names=("wind_speed", "wind_direction"),
    units={"wind_speed": "m/s", "wind_direction": "°"},
    offline_after=3,
    wind=WindInfo(WindValues("wind_speed", "wind_direction", "m/s"), every=10.0, records=600.0),
)


@dataclass(frozen=True)
class WindExamples:
    """The newest payload of each topic."""

    wind: object
    record: object


def wind_examples() -> WindExamples:
    """Return what is published."""
    station = WindStation(LINE, BOOT, [_MAST], _at(0))
    newest: dict[str, object] = {}
    for second in range(1, SECONDS):
        at = second + 0.003
        speed = round(6.2 + 2.4 * sin(second / 9.7) + 1.3 * sin(second / 2.9), 2)
        direction = round(222 + 31 * sin(second / 41) + 9 * sin(second / 3.3), 1)
        values = {"wind_speed": speed, "wind_direction": direction}
        station.on_reading(
            Reading("mast-top", at, values, None, rtt=0.0182, online=True, response_timeout=0.062), _at(at)
        )
        published = station.tick(_at(at)) if station.due <= at else []
        newest.update((each.topic, each.payload) for each in published)
    return WindExamples(newest[device_topic("mast-top", WIND)], newest[device_topic("mast-top", RECORD)])


def _at(mono: float) -> Instant:
    return Instant(mono, BEGUN + mono, "synced")
