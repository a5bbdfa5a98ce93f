"""What has been heard from the broker, as both views show it. Pure: the caller reads the clock and the network."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from lfs10d.cli.demo.scenario import CAST, Role

KEPT: Final = 60
"""Samples of the trend."""

TOPICS: Final = ("device/+/telemetry", "device/+/availability", "device/+/error", "line/stats")
"""What is listened to, under `B`."""


@dataclass(slots=True)
class DemoRow:
    """One sensor as MQTT tells of it."""

    role: Role
    speed: float | None = None
    """m/s by the last sample; None where that failed, or there is none."""
    fault: str | None = None
    """Error code of the last sample."""
    message: str | None = None
    """The sensor's active error in words."""
    online: bool | None = None
    """None: nothing heard yet."""
    samples: int = 0
    failed: int = 0
    trend: deque[float | None] = field(default_factory=lambda: deque(maxlen=KEPT))

    @property
    def state(self) -> str:
        """`online`, `offline`, or `...` before anything was heard."""
        return "..." if self.online is None else "online" if self.online else "offline"

    @property
    def error(self) -> str:
        """What is wrong now, or how often something was; empty if nothing ever."""
        if self.message is not None:
            return self.message
        if self.fault is not None:
            return self.fault
        return f"{self.failed} of {self.samples} polls failed" if self.failed else ""


@dataclass(frozen=True, slots=True)
class LineFigures:
    """The line by its last statistics; gaps in us."""

    polls_per_s: float
    load_pct: float
    gap_min: float
    gap_required: float


class DemoState:
    """A row for each sensor, and the line's figures."""

    def __init__(self, cast: Sequence[Role] = CAST) -> None:
        self.rows = {role.name: DemoRow(role) for role in cast}
        self.line: LineFigures | None = None
        """None before the first statistics."""

    def heard(self, topic: str, payload: bytes) -> None:
        """Take a message; `topic` is relative to `B`. What is none of ours changes nothing."""
        match topic.split("/"):
            case ["line", "stats"]:
                self._figures(json.loads(payload))
            case ["device", name, "availability"] if name in self.rows:
                self.rows[name].online = payload == b"online"
            case ["device", name, "error"] if name in self.rows:
                error = json.loads(payload)
                self.rows[name].message = f"{error['code']}: {error['message']}" if error["active"] else None
            case ["device", name, "telemetry"] if name in self.rows:
                self._sample(self.rows[name], json.loads(payload))
            case _:
                pass

    @property
    def samples(self) -> int:
        """Samples heard of all sensors."""
        return sum(row.samples for row in self.rows.values())

    @property
    def online(self) -> int:
        """Sensors that are online."""
        return sum(row.online is True for row in self.rows.values())

    @staticmethod
    def _sample(row: DemoRow, sample: dict[str, Any]) -> None:
        row.speed, row.fault = sample["wind_speed"], sample["error"]
        row.samples += 1
        row.failed += row.speed is None
        row.trend.append(row.speed)

    def _figures(self, stats: dict[str, Any]) -> None:
        figures = (stats["polls_per_s"], stats["load_pct"], stats["gap_us"]["min"], stats["gap_required_us"])
        self.line = None if None in figures else LineFigures(*figures)  # None: too early to say
