"""What a newcomer is shown: the retained topics, and whether a stale value looks live on them. Pure.

Live is a good value of a device that is online, of a daemon that is online.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

STALE_AFTER = 6.0
"""Seconds: a state is renewed once a second while polls succeed, and at once when one fails."""


@dataclass(slots=True)
class Shown:
    """The newest of each retained topic that matters here."""

    daemon: str = ""
    devices: dict[str, str] = field(default_factory=dict)
    states: dict[str, dict[str, Any]] = field(default_factory=dict)

    def note(self, topic: str, payload: bytes) -> None:
        """Take note of a message; an empty topic: the subscriber is told everything anew."""
        parts = topic.split("/")
        if not topic:
            self.clear()
        elif topic == "availability":
            self.daemon = payload.decode()
        elif parts[-1] == "availability":
            self.devices[parts[1]] = payload.decode()
        elif parts[-1] == "state":
            self.states[parts[1]] = json.loads(payload)

    def clear(self) -> None:
        """Forget all: the broker has."""
        self.daemon = ""
        self.devices.clear()
        self.states.clear()

    def stale(self, now: float) -> list[str]:
        """Return what looks live and is not, at `now` in epoch seconds."""
        if self.daemon != "online":
            return []
        return [
            f"{device}: {state['wind_speed']} of {now - state['ts'] / 1000:.1f} s ago is shown as live"
            for device, state in self.states.items()
            if state["quality"] == "good"
            and self.devices.get(device) == "online"
            and now - state["ts"] / 1000 > STALE_AFTER
        ]
