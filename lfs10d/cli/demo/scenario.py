"""The eight sensors of the demo, two of them faulty, and the files that configure simulator and daemon."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

from lfs10d.system.dataclass import dataclass

BASE_TOPIC: Final = "lfs10d"
LINE: Final = "line0"
BAUDRATE: Final = 9600
INTERVAL: Final = "500ms"


@dataclass(frozen=True, slots=True)
class DemoSensor:
    """One sensor; `fault` is an entry of the simulator's fault file, `remark` says to a person what it shows."""

    slave: int
    name: str
    label: str
    fault: dict[str, object] | None = None
    remark: str | None = None


SENSORS: Final = (
    DemoSensor(2, "mast-top", "Mast, 10 m"),
    DemoSensor(3, "mast-mid", "Mast, 6 m"),
    DemoSensor(4, "mast-low", "Mast, 2 m"),
    DemoSensor(5, "roof-n", "Roof, north"),
    DemoSensor(6, "roof-s", "Roof, south"),
    DemoSensor(
        7,
        "crane",
        "Crane jib",
        {"fault": "silent"},
        "is silent, as if its cable were cut: it barely slows the others.",
    ),
    DemoSensor(
        8,
        "bridge",
        "Bridge",
        {"fault": "noisy", "rate": 0.25},
        "is noisy, as beside a motor drive: a damaged reply is never published.",
    ),
    DemoSensor(9, "harbour", "Harbour gate"),
)
"""Id 1, the factory's, stays free as on a real line."""


def configuration(port: Path, broker_port: int, mqtt_version: str) -> str:
    """Return the daemon's configuration file, YAML."""
    slaves = "".join(
        f'  - {{id: {sensor.slave}, name: {sensor.name}, label: "{sensor.label}"}}\n' for sensor in SENSORS
    )
    return (
        f"line: {{name: {LINE}, port: {json.dumps(str(port))}, baudrate: {BAUDRATE}}}\n"
        f"poll: {{interval: {INTERVAL}}}\n"
        "wind: {every: 2s}\n"
        f"slaves:\n{slaves}"
        f"mqtt: {{host: 127.0.0.1, port: {broker_port}, version: {mqtt_version}, base_topic: {BASE_TOPIC}}}\n"
    )


def faults() -> str:
    """Return the simulator's fault file, YAML."""
    return "slaves:\n" + "".join(
        f"  {sensor.slave}: {json.dumps(sensor.fault)}\n" for sensor in SENSORS if sensor.fault
    )


def slaves() -> str:
    """Return the ids as `lfs10d simulate --slaves` takes them."""
    return ",".join(str(sensor.slave) for sensor in SENSORS)
