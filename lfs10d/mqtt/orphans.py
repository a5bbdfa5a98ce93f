"""Retained topics that a daemon left behind, whose devices are no longer configured. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from collections.abc import Set as AbstractSet
from dataclasses import field
from itertools import islice

from lfs10d.mqtt.topics import Topics
from lfs10d.system.dataclass import dataclass

QUIET = 0.5
"""Seconds without a retained message, once the broker has answered, after which the broker has sent them all."""

LONGEST = 120.0
"""Seconds after which a search ends in any case; a slow gateway takes 30 s for 60 000 messages."""


AT_ONCE = 64
"""Topics that are cleared in one go of the loop, about 10 us each."""


@dataclass(slots=True)
class OrphanSearch:
    """Collects what is retained under the devices' topics from `begun` on (monotonic seconds)."""

    topics: Topics
    begun: float
    _found: dict[str, None] = field(default_factory=dict)
    _last_at: float | None = None

    def subscribed(self, now: float) -> None:
        """Take the broker's answer to the subscription; some send it before what they retain, some after."""
        self._last_at = now

    def on_message(self, topic: str, payload: bytes, now: float) -> bool:
        """Take one retained message; return False if it is not one of a device's topics."""
        relative = self.topics.relative(topic)
        if relative is None or not self.topics.is_owned(relative):
            return False
        self._last_at = now
        if payload:
            self._found[relative] = None
        return True

    @property
    def due(self) -> float:
        """When the search ends if nothing more comes."""
        latest = self.begun + LONGEST
        return latest if self._last_at is None else min(self._last_at + QUIET, latest)

    def orphans(self, owned: Callable[[], AbstractSet[str]]) -> Iterator[tuple[str, ...]]:
        """Yield the topics under `B` to be cleared, at most `AT_ONCE` each time, as they were found.

        A topic that is owned when its turn comes is none.
        """
        found = iter(self._found)
        while some := tuple(islice(found, AT_ONCE)):
            ours = owned()
            yield tuple(topic for topic in some if topic not in ours)
