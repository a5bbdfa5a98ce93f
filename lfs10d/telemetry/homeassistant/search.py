"""Finds the earlier discovery payloads of a daemon at the broker, after a connect. Pure; time is an argument."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Final

from pydantic_core import from_json

from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.homeassistant.discovery import Platforms, platforms
from lfs10d.telemetry.homeassistant.gateway import config_topic, is_about, object_id

QUIET: Final = 0.5
"""Seconds without a retained message after which the broker has sent them all."""
LONGEST: Final = 30.0
"""Seconds after which a search ends in any case."""
LARGEST: Final = 262_144
"""Largest payload that is read, in bytes; ours have some 10 KB."""


@dataclass(slots=True)
class DiscoverySearch:
    """Collects the payloads under `prefix` of the daemon at `base`, from `begun` on (monotonic seconds).

    `wide`: all of it; else the line alone, whose payload is cleared last: where it is not, nothing is.
    """

    prefix: str
    base: str
    begun: float
    wide: bool
    found: dict[str, Platforms] = field(default_factory=dict)
    """The components of each payload by its full topic."""
    is_refused: bool = False
    """The broker refused the subscription."""
    _last_at: float | None = None

    @property
    def filter(self) -> str:
        """What to subscribe to."""
        return config_topic(self.prefix, "+" if self.wide else object_id(self.base))

    def on_message(self, topic: str, payload: bytes, now: float) -> bool:
        """Take one retained message; return False if it is no discovery payload."""
        parts = topic.removeprefix(f"{self.prefix}/").split("/")
        match parts:
            case ["device", identifier, "config"]:
                self._last_at = now
            case _:
                return False
        if identifier.startswith(object_id(self.base)) and 0 < len(payload) <= LARGEST:
            self._take(topic, payload)
        return True

    def _take(self, topic: str, payload: bytes) -> None:
        try:
            announced = from_json(payload, allow_inf_nan=False)
        except ValueError:
            return
        if isinstance(announced, Mapping) and is_about(announced, f"{self.base}/availability"):
            self.found[topic] = platforms(announced)

    @property
    def due(self) -> float:
        """When it is over."""
        last_at = self.begun if self._last_at is None else self._last_at
        return self.begun if self.is_refused else min(last_at + QUIET, self.begun + LONGEST)
