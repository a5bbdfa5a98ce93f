"""The retained topics that wait: the newest version of each, a burst of all of them, and what goes last in it. Pure.

What clears a topic waits apart and goes when nothing else does: there may be thousands. What the broker refuses is
kept apart until its topic is tried again.
"""

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
        self._clearings: dict[str, Retained] = {}
        self._passed_over: dict[str, Retained] = {}
        self._under_way: set[str] = set()
        self._burst: set[str] = set()
        self._last: Retained | None = None
        self._closing: Retained | None = None  # the `last` that is not settled yet

    def __bool__(self) -> bool:
        """Tell whether anything waits."""
        return bool(self._waiting or self._clearings) or self._last is not None

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
        self._wait(Retained(publication))

    def _wait(self, letter: Retained) -> None:
        clearing = letter.publication.payload is None
        (self._waiting if clearing else self._clearings).pop(letter.topic, None)
        (self._clearings if clearing else self._waiting)[letter.topic] = letter

    def burst(self, publications: Iterable[Publication], last: Publication) -> None:
        """Take all topics, then `last`."""
        for publication in publications:
            self.add(publication)
            if publication.payload is not None:
                self._burst.add(publication.topic)
        self._last = self._closing = Retained(last)

    def next(self, refused: AbstractSet[str]) -> Retained | None:
        """Take what goes next, nothing that clears a topic; topics the broker refuses are passed over."""
        letter = self._take(self._waiting, refused)
        if letter is not None:
            return letter
        if self._burst or self._last is None or self._last.topic in self._under_way:
            return None
        last, self._last = self._last, None
        if last.topic in refused:
            self._passed_over[last.topic] = last
            self._closing = None
            return None
        self._under_way.add(last.topic)
        return last

    def next_clearing(self, refused: AbstractSet[str]) -> Retained | None:
        """Take what clears a topic."""
        return self._take(self._clearings, refused)

    def _take(self, waiting: dict[str, Retained], refused: AbstractSet[str]) -> Retained | None:
        for topic in refused:
            if topic in waiting:
                self._passed_over[topic] = waiting.pop(topic)
                self._burst.discard(topic)
        # At most as many are looked at as are under way.
        for topic in waiting:
            if topic not in self._under_way:
                self._under_way.add(topic)
                return waiting.pop(topic)
        return None

    def lifted(self, topics: AbstractSet[str]) -> None:
        """Let what was passed over of these topics wait again, unless a newer version does."""
        for topic in topics & self._passed_over.keys():
            self._wait_unless_newer(self._passed_over.pop(topic))

    def refused(self, letter: Retained) -> None:
        """Let what the broker refused wait until its topic is tried again, unless a newer version does."""
        self._wait_unless_newer(letter)

    def _wait_unless_newer(self, letter: Retained) -> None:
        if letter.topic not in self._waiting and letter.topic not in self._clearings:
            self._wait(letter)

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
        self._waiting.clear()
        self._passed_over = {
            topic: each for topic, each in self._passed_over.items() if each.publication.payload is None
        }

    def put_back(self, letter: Retained) -> None:
        """Let a clearing that was under way wait again, unless a newer version does."""
        if letter.publication.payload is None:
            self._wait_unless_newer(letter)
