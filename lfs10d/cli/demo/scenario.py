"""The eight sensors of the demo, what ails two of them, and the files that say so to simulator and daemon."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

BASE_TOPIC: Final = "lfs10d"
LINE: Final = "line0"
BAUDRATE: Final = 9600
INTERVAL: Final = "500ms"


@dataclass(frozen=True, slots=True)
class Role:
    """One sensor; `trouble` is a fault of the simulator's, `story` tells a person what it shows."""

    slave: int
    name: str
    label: str
    trouble: dict[str, object] | None = None
    story: str | None = None


CAST: Final = (
    Role(2, "mast-top", "Mast, 10 m"),
    Role(3, "mast-mid", "Mast, 6 m"),
    Role(4, "mast-low", "Mast, 2 m"),
    Role(5, "roof-n", "Roof, north"),
    Role(6, "roof-s", "Roof, south"),
    Role(
        7,
        "crane",
        "Crane jib",
        {"fault": "silent"},
        "is silent, as if its cable were cut: it is asked rarely and delays nobody.",
    ),
    Role(
        8,
        "bridge",
        "Bridge",
        {"fault": "noisy", "rate": 0.25},
        "is noisy, as beside a motor drive: a damaged answer is never published.",
    ),
    Role(9, "harbour", "Harbour gate"),
)
"""Id 1, the factory's, stays free as on a real line."""


def configuration(port: Path, broker_port: int, mqtt_version: str) -> str:
    """Return the daemon's file, YAML."""
    slaves = "".join(f'  - {{id: {role.slave}, name: {role.name}, label: "{role.label}"}}\n' for role in CAST)
    return (
        f"line: {{name: {LINE}, port: {json.dumps(str(port))}, baudrate: {BAUDRATE}}}\n"
        f"poll: {{interval: {INTERVAL}}}\n"
        f"slaves:\n{slaves}"
        f"mqtt: {{host: 127.0.0.1, port: {broker_port}, version: {mqtt_version}, base_topic: {BASE_TOPIC}}}\n"
    )


def faults() -> str:
    """Return the simulator's faults file, YAML."""
    return "slaves:\n" + "".join(f"  {role.slave}: {json.dumps(role.trouble)}\n" for role in CAST if role.trouble)


def slaves() -> str:
    """Return the ids as `lfs10d simulate --slaves` takes them."""
    return ",".join(str(role.slave) for role in CAST)
