"""Retained topics that a daemon left behind, whose devices are no longer configured. Pure."""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field

from lfs10d.mqtt.topics import Topics

QUIET = 0.5
"""Seconds without a retained message after which the broker has sent them all."""

LONGEST = 120.0
"""Seconds after which a search ends in any case; a slow gateway takes 30 s for 60 000 messages, which come anyway."""


@dataclass(slots=True)
class OrphanSearch:
    """Collects what is retained under the devices' topics from `begun` on (monotonic seconds)."""

    topics: Topics
    begun: float
    _found: set[str] = field(default_factory=set)
    _last_at: float = 0.0

    def __post_init__(self) -> None:
        self._last_at = self.begun

    def on_message(self, topic: str, payload: bytes, now: float) -> bool:
        """Take one retained message; return False if it is not one of a device's topics."""
        relative = self.topics.relative(topic)
        if relative is None or not self.topics.is_owned(relative):
            return False
        self._last_at = now
        if payload:
            self._found.add(relative)
        return True

    @property
    def due(self) -> float:
        """When it is over."""
        return min(self._last_at + QUIET, self.begun + LONGEST)

    def orphans(self, owned: AbstractSet[str]) -> tuple[str, ...]:
        """Return the topics under `B` to be cleared, in order."""
        return tuple(sorted(self._found - owned))
