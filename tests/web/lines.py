"""A line of the page in virtual time: what a daemon publishes, as messages."""

from __future__ import annotations

from typing import Any

from lfs10d.web.line_model import LineModel, Link

PLACE = "broker localhost:1883"
READ = "/api/line0/request/device/read"
"""The address of a request to it."""
WALL = 1_800_000_000.0
"""Epoch s; the daemon's clock is right."""


def sample(seq: int, ts: float, value: float | None = 5.0, **more: Any) -> dict[str, Any]:  # noqa: ANN401 - any JSON
    """Return a sample; `ts` in epoch s."""
    good = value is not None
    return {
        "v": 1, "line": "line0", "device": "mast", "boot": "boot0001", "seq": seq, "ts": round(ts * 1000),
        "wind_speed": value, "unit": "m/s", "quality": "good" if good else "bad",
        "error": None if good else "timeout", "rtt_ms": 20.0 if good else None, **more,
    }  # fmt: skip


def entry(name: str = "mast", **more: Any) -> dict[str, Any]:  # noqa: ANN401 - any JSON
    """Return an entry of `devices`."""
    return {"name": name, "id": 2, "label": "Mast", "profile": "lfs10", "enabled": True, "interval": 1.0, **more}


class PublishedLine:
    """A line whose daemon is connected, with one device `mast`."""

    def __init__(self, *entries: dict[str, Any], line: LineModel | None = None) -> None:
        self.model = LineModel("line0", "line0", "lfs10d", Link(PLACE, connected=True)) if line is None else line
        self.model.link.connected = True
        self.wall = WALL
        self.publish("availability", "online")
        self.publish("devices", list(entries) or [entry()])

    def publish(self, topic: str, payload: Any, *, old: bool = False, after: float = 0.0) -> None:  # noqa: ANN401 - any JSON
        """Take a message `after` seconds."""
        self.wall += after
        self.model.on_message(topic, payload, old=old, now=self.wall - WALL, wall=self.wall)

    def measure(self, seq: int, value: float | None = 5.0, *, after: float = 1.0, name: str = "mast") -> None:
        """Take a sample of a device, `after` seconds."""
        self.wall += after
        self.publish(f"device/{name}/telemetry", sample(seq, self.wall, value))

    @property
    def device(self) -> dict[str, Any]:
        """The summary of the first device."""
        return next(iter(self.model.devices(None, self.wall)))[1]
