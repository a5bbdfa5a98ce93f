"""The queue of retained topics: the newest version of each, and the burst of all of them after a connect. Pure.

Changes and refreshes (`Publication.refresh`: only newer figures) wait apart, each in the order in which they came. A
refresh of a topic whose change waits replaces that version in its place; a change takes the place of a refresh. What
clears a topic waits apart too: there may be thousands. What the broker refuses is
kept apart until its topic is tried again.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Set as AbstractSet

from lfs10d.outbox.items import Retained
from lfs10d.telemetry.publication import Publication


class RetainedQueue:
    """Of each topic one version waits and one is under way at most."""

    def __init__(self) -> None:
        self.changes: dict[str, Retained] = {}
        self.refreshes: dict[str, Retained] = {}
        self.clearings: dict[str, Retained] = {}
        self.last: Retained | None = None
        """The end of a burst that waits for its turn: nothing else may go now."""
        self._passed_over: dict[str, Retained] = {}
        self._under_way: set[str] = set()
        self._burst: set[str] = set()
        self._closing: Retained | None = None  # the `last` that is not acknowledged yet

    def __bool__(self) -> bool:
        """Return whether anything waits."""
        return bool(self.changes or self.refreshes or self.clearings) or self.last is not None

    @property
    def announced(self) -> bool:
        """The last burst is acknowledged, its `last` too."""
        return self._closing is None

    def add(self, publication: Publication, now: float) -> bool:
        """Take the newest version of a topic; return True if it replaces a refresh that waited since before `now`."""
        waiting = self.refreshes.get(publication.topic)
        self._wait(Retained(publication, now))
        return waiting is not None and waiting.since < now

    def _wait(self, item: Retained) -> None:
        publication, queue = item.publication, self.changes
        topic = publication.topic
        if publication.payload is None:
            queue = self.clearings
        elif publication.refresh and topic not in self.changes:
            queue = self.refreshes
        for other in (self.changes, self.refreshes, self.clearings):
            if other and other is not queue:
                other.pop(topic, None)
        queue[topic] = item

    def burst(self, publications: Iterable[Publication], last: Publication) -> None:
        """Take all topics, then `last`: within a burst a refresh is a change, for `last` waits for it."""
        for publication in publications:
            item = Retained(publication)
            if publication.payload is None:
                self._wait(item)
            else:
                self.refreshes.pop(publication.topic, None)
                self.clearings.pop(publication.topic, None)
                self.changes[publication.topic] = item
                self._burst.add(publication.topic)
        self.last = self._closing = Retained(last)

    def next_change(self, refused: AbstractSet[str]) -> Retained | None:
        """Take the change, or the `last` of the burst, that goes next; topics the broker refuses are passed over."""
        item = self.take(self.changes, refused)
        if item is not None:
            return item
        if self._burst or self.last is None or self.last.topic in self._under_way:
            return None
        last, self.last = self.last, None
        if last.topic in refused:
            self._passed_over[last.topic] = last
            self._closing = None
            return None
        self._under_way.add(last.topic)
        return last

    def take(self, waiting: dict[str, Retained], refused: AbstractSet[str]) -> Retained | None:
        """Take what goes next of those `waiting`: `changes`, `refreshes` or `clearings`."""
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
            self.wait_again(self._passed_over.pop(topic))

    def wait_again(self, item: Retained) -> None:
        """Let what did not arrive wait, unless a newer version does."""
        if not any(item.topic in queue for queue in (self.changes, self.refreshes, self.clearings)):
            self._wait(item)

    def over(self, item: Retained) -> None:
        """Note that an item is no longer under way, acknowledged or dead."""
        topic = item.topic
        self._under_way.discard(topic)
        self._burst.discard(topic)
        if item is self._closing:
            self._closing = None

    def lost(self) -> None:
        """Forget everything but what clears a topic: the next burst holds it."""
        self._under_way.clear()
        self._burst.clear()
        self.last = self._closing = None
        self.changes.clear()
        self.refreshes.clear()
        self._passed_over = {
            topic: each for topic, each in self._passed_over.items() if each.publication.payload is None
        }

    def put_back(self, item: Retained) -> None:
        """Let a clearing that was under way wait again, unless a newer version does."""
        if item.publication.payload is None:
            self.wait_again(item)
