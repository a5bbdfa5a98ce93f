"""Reads the daemon's own retained topics of an earlier run before they are overwritten. Pure."""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from dataclasses import field

from lfs10d.mqtt.topics import Topics
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry import publication

QUIET_LEAST, QUIET_MOST = 0.05, 0.5
"""Seconds without a message, after the broker's answer or the last message, that end the search."""

QUIET_ROUNDS = 4
"""Multiple of the broker's response time that is added: a distant broker delivers irregularly."""

LONGEST = 5.0
"""Seconds after which the search ends in any case."""

FILTERS = (publication.LINE_STATE, publication.device_topic("+", publication.CONFIG))
"""Two filters whatever is wanted: some brokers take eight at most."""


@dataclass(slots=True)
class Lookback:
    """Collects the `wanted` topics under `B` from `begun` on (monotonic seconds); `found` are their payloads."""

    topics: Topics
    wanted: AbstractSet[str]
    begun: float
    found: dict[str, bytes] = field(default_factory=dict)
    _last_at: float | None = None
    _quiet: float = QUIET_MOST
    _refused: bool = False

    @property
    def filters(self) -> tuple[str, ...]:
        """The filters to subscribe to."""
        return tuple(self.topics.full(each) for each in FILTERS)

    def subscribed(self, now: float, *, refused: bool) -> None:
        """Take the broker's answer; `refused` if nothing will come."""
        self._last_at = now
        self._quiet = min(QUIET_MOST, QUIET_LEAST + QUIET_ROUNDS * (now - self.begun))
        self._refused = refused

    def on_message(self, topic: str, payload: bytes, now: float) -> None:
        """Take one retained message; others are ignored, and do not prolong the search."""
        relative = self.topics.relative(topic)
        if relative is not None and relative in self.wanted:
            self._last_at = now
            self.found[relative] = payload

    def due(self, now: float) -> float:
        """Return when it is over if nothing more comes, `now` if it is."""
        if self._refused or self.wanted <= self.found.keys():
            return now
        latest = self.begun + LONGEST
        return latest if self._last_at is None else min(self._last_at + self._quiet, latest)
