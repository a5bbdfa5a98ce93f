"""What the live view receives."""

from __future__ import annotations

from typing import Any

from lfs10d.cli.render.live_state import LiveState, ShownDevice

WALL = 1_795_298_000.0


class Heard:
    """A view from MQTT with a clock; our wall clock is `ahead` s ahead of the daemon's."""

    def __init__(self, *names: str, ahead: float = 0.0) -> None:
        self.live = LiveState("line0")
        self.now = 100.0
        self.ahead = ahead
        self.seqs: dict[str, int] = {}
        self.tell("devices", [{"name": name, "id": 2 + place, "interval": 1.0} for place, name in enumerate(names)])

    @property
    def wall(self) -> float:
        return WALL + self.now + self.ahead

    def tell(self, topic: str, payload: Any, *, old: bool = False) -> None:  # noqa: ANN401 - any JSON
        self.live.on_message(topic, payload, old=old, now=self.now, wall=self.wall)

    def sample(
        self,
        name: str,
        value: float | None,
        *,
        leaf: str = "telemetry",
        old: bool = False,
        **keys: str | float,
    ) -> None:
        self.seqs[name] = self.seqs.get(name, 0) + 1
        sample = {
            "seq": self.seqs[name],
            "boot": "aaaaaaaa",
            "ts": round((WALL + self.now) * 1000),
            "wind_speed": value,
            "unit": "m/s",
            "quality": "bad" if value is None else "good",
            "error": "timeout" if value is None else None,
            "rtt_ms": None if value is None else 18.2,
        }
        self.tell(f"device/{name}/{leaf}", {**sample, **keys}, old=old)

    def device(self, name: str) -> ShownDevice:
        return self.live.devices[name]

    def age(self, name: str) -> float | None:
        return self.live.age(self.device(name), self.wall)

    @property
    def moved(self) -> list[str]:
        return [device.name for device in self.live.movers(self.now)]
