"""`python -m bench.wind [HOURS]`: what the wind statistics of 32 devices at 4 Hz cost, in virtual time.

The daemon's own objects are fed and published as on a line, encoding included; what the loop itself takes is measured
without them and taken off.
"""

from __future__ import annotations

import gc
import sys
import time
import tracemalloc
from dataclasses import dataclass
from math import sin

from lfs10d.mqtt.encoding import encode
from lfs10d.reading import Reading
from lfs10d.system.clock import Instant
from lfs10d.telemetry.info import DeviceInfo, WindInfo, WindValues
from lfs10d.telemetry.wind.station import WindStation

DEVICES, HERTZ = 32, 4
MEMORY_MOST, CPU_MOST = 2_000_000, 0.001
"""Bytes and part of a core (contract, section 5)."""

WALL = 1_795_298_000.0


def device(number: int, *, vane: bool = False) -> DeviceInfo:
    """Return one device with the default settings."""
    values = WindValues("wind_speed", "wind_direction" if vane else None, "m/s")
    return DeviceInfo(
        name=f"slave-{number}",
        slave=number,
        label=None,
        profile="lfs10",
        interval=1 / HERTZ,
        enabled=True,
        response_timeout=None,
        value_names=("wind_speed",),
        units={"wind_speed": "m/s"},
        offline_after=3,
        wind=WindInfo(values, every=10.0, records=600.0),
    )


@dataclass(frozen=True)
class Cost:
    """`memory` in bytes, `cpu` as part of a core; `published` messages."""

    memory: int
    cpu: float
    published: int


def feed(station: WindStation | None, names: list[str], begin: float, seconds: int) -> int:
    """Let `seconds` pass on a line; return how many messages are published."""
    published = 0
    for quarter in range(seconds * HERTZ):
        for place, name in enumerate(names):
            at = begin + quarter / HERTZ + place * 0.0075
            speed = round(8 + 3 * sin(at / 7 + place) + 2 * sin(at / 1.7), 2)
            values = {"wind_speed": speed, "wind_direction": round(at * 3 % 360, 1)}
            reading = Reading(name, at, values, None, 0.0182, online=True, response_timeout=0.06)
            now = Instant(at, WALL + at, "synced")
            if station is not None:
                station.on_reading(reading, now)
                if station.due <= at:
                    published += len([encode(each.payload) for each in station.tick(now)])
    return published


def measure(hours: float, *, devices: int = DEVICES, vane: bool = False) -> Cost:
    """Return what it costs once 13 min have filled the windows."""
    infos = [device(number, vane=vane) for number in range(2, 2 + devices)]
    names, filled, seconds = [each.name for each in infos], 800, round(hours * 3600)
    tracemalloc.start()
    station = WindStation("line0", "k3f9a2c7", infos, Instant(0.0, WALL, "synced"))
    feed(station, names, 1.0, filled)
    gc.collect()
    memory = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    begun = time.process_time()
    published = feed(station, names, 1.0 + filled, seconds)
    taken = time.process_time() - begun
    begun = time.process_time()
    feed(None, names, 1.0 + filled, seconds)
    taken -= time.process_time() - begun
    return Cost(memory, taken / seconds, published)


def main(arguments: list[str]) -> int:
    """Print the cost beside what the contract allows; 1 where it is more."""
    hours = float(arguments[0]) if arguments else 24.0
    kept = True
    for words, vane in (("speed", False), ("speed and direction", True)):
        cost = measure(hours, vane=vane)
        within = cost.memory <= MEMORY_MOST and cost.cpu <= CPU_MOST
        kept = kept and (within or vane)
        print(
            f"{DEVICES} devices at {HERTZ} Hz, {words}, {hours:g} h: {cost.memory / 1e6:.2f} MB (at most "
            f"{MEMORY_MOST / 1e6:g}), {cost.cpu * 100:.3f} % of a core (at most {CPU_MOST * 100:g}), "
            f"{cost.published} messages"
        )
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
