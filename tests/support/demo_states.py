"""What the demo heard."""

from __future__ import annotations

import json

from lfs10d.cli.demo.state import DemoState


class Told:
    """A picture that is told things in short."""

    def __init__(self) -> None:
        self.picture = DemoState()

    def sample(self, name: str, speed: float | None, error: str | None = None) -> None:
        """Let a sensor's sample be heard."""
        payload = {"wind_speed": speed, "quality": "good" if error is None else "bad", "error": error}
        self.picture.heard(f"device/{name}/telemetry", json.dumps(payload).encode())

    def availability(self, name: str, word: str) -> None:
        """Let `online` or `offline` be heard."""
        self.picture.heard(f"device/{name}/availability", word.encode())

    def error(self, name: str, code: str | None, message: str = "") -> None:
        """Let an error be heard; None: all is well."""
        payload = {"active": code is not None, "code": code, "message": message}
        self.picture.heard(f"device/{name}/error", json.dumps(payload).encode())

    def stats(self, polls_per_s: float | None, load_pct: float | None, gap_min: float | None) -> None:
        """Let the line's statistics be heard."""
        payload = {
            "polls_per_s": polls_per_s,
            "load_pct": load_pct,
            "gap_us": {"min": gap_min},
            "gap_required_us": 3645.8,
        }
        self.picture.heard("line/stats", json.dumps(payload).encode())
