"""The retained topics that wait: the newest version of each, a burst of all of them, and what goes last in it. Pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lfs10d.mqtt.letters import Retained

if TYPE_CHECKING:
    from collections.abc import Iterable
    from collections.abc import Set as AbstractSet

    from lfs10d.telemetry import Publication


class Retention:
    """Of each topic one version waits and one is under way at most."""

    def __init__(self) -> None:
        self._waiting: dict[str, Retained] = {}
        self._under_way: set[str] = set()
        self._burst: set[str] = set()
        self._last: Retained | None = None
        self._closing: Retained | None = None  # the `last` that is not settled yet

    def __bool__(self) -> bool:
        """Tell whether anything waits."""
        return bool(self._waiting) or self._last is not None

    @property
    def announced(self) -> bool:
        """The last burst is settled, its `last` too."""
        return self._closing is None

    @property
    def first(self) -> bool:
        """Nothing else may go now: the `last` of a burst waits for its turn."""
        return self._last is not None

    def add(self, publication: Publication) -> None:
        """Take the newest version of a topic."""
        self._waiting[publication.topic] = Retained(publication)

    def burst(self, publications: Iterable[Publication], last: Publication) -> None:
        """Take all topics, then `last`."""
        for publication in publications:
            self.add(publication)
            self._burst.add(publication.topic)
        self._last = self._closing = Retained(last)

    def next(self, refused: AbstractSet[str]) -> Retained | None:
        """Take what goes next; topics the broker refuses are passed over."""
        for topic in list(self._waiting):
            if topic in refused:
                del self._waiting[topic]
                self._burst.discard(topic)
            elif topic not in self._under_way:
                self._under_way.add(topic)
                return self._waiting.pop(topic)
        if self._burst or self._last is None or self._last.topic in self._under_way:
            return None
        last, self._last = self._last, None
        if last.topic in refused:
            self._closing = None
            return None
        self._under_way.add(last.topic)
        return last

    def over(self, letter: Retained) -> None:
        """Note that a letter is no longer under way, settled or dead."""
        self._under_way.discard(letter.topic)
        self._burst.discard(letter.topic)
        if letter is self._closing:
            self._closing = None

    def lost(self) -> None:
        """Forget everything but what clears a topic: the next burst holds it."""
        self._under_way.clear()
        self._burst.clear()
        self._last = self._closing = None
        self._waiting = {topic: each for topic, each in self._waiting.items() if each.publication.payload is None}

    def put_back(self, letter: Retained) -> None:
        """Let a clearing that was under way wait again, unless a newer version does."""
        if letter.publication.payload is None:
            self._waiting.setdefault(letter.topic, letter)
