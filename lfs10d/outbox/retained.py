"""The retained topics that wait: the newest version of each, a burst of all of them, and what goes last in it. Pure.

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
        self._changes: dict[str, Retained] = {}
        self._refreshes: dict[str, Retained] = {}
        self._clearings: dict[str, Retained] = {}
        self._passed_over: dict[str, Retained] = {}
        self._under_way: set[str] = set()
        self._burst: set[str] = set()
        self._last: Retained | None = None
        self._closing: Retained | None = None  # the `last` that is not acknowledged yet

    def __bool__(self) -> bool:
        """Tell whether anything waits."""
        return bool(self._changes or self._refreshes or self._clearings) or self._last is not None

    @property
    def announced(self) -> bool:
        """The last burst is acknowledged, its `last` too."""
        return self._closing is None

    @property
    def first(self) -> bool:
        """Nothing else may go now: the `last` of a burst waits for its turn."""
        return self._last is not None

    def add(self, publication: Publication) -> bool:
        """Take the newest version of a topic; return True if it replaces a refresh that still waited."""
        replaced = publication.topic in self._refreshes
        self._wait(Retained(publication))
        return replaced

    def _wait(self, item: Retained) -> None:
        topic, queue = item.topic, self._changes
        if item.publication.payload is None:
            queue = self._clearings
        elif item.publication.refresh and topic not in self._changes:
            queue = self._refreshes
        for other in (self._changes, self._refreshes, self._clearings):
            if other is not queue:
                other.pop(topic, None)
        queue[topic] = item

    def burst(self, publications: Iterable[Publication], last: Publication) -> None:
        """Take all topics, then `last`: within a burst a refresh is a change, for `last` waits for it."""
        for publication in publications:
            item = Retained(publication)
            if publication.payload is None:
                self._wait(item)
            else:
                self._refreshes.pop(publication.topic, None)
                self._clearings.pop(publication.topic, None)
                self._changes[publication.topic] = item
                self._burst.add(publication.topic)
        self._last = self._closing = Retained(last)

    def next_change(self, refused: AbstractSet[str]) -> Retained | None:
        """Take the change, or the `last` of the burst, that goes next; topics the broker refuses are passed over."""
        item = self._take(self._changes, refused)
        if item is not None:
            return item
        if self._burst or self._last is None or self._last.topic in self._under_way:
            return None
        last, self._last = self._last, None
        if last.topic in refused:
            self._passed_over[last.topic] = last
            self._closing = None
            return None
        self._under_way.add(last.topic)
        return last

    def next_refresh(self, refused: AbstractSet[str]) -> Retained | None:
        """Take the refresh that goes next."""
        return self._take(self._refreshes, refused)

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

    def refused(self, item: Retained) -> None:
        """Let what the broker refused wait until its topic is tried again, unless a newer version does."""
        self._wait_unless_newer(item)

    def _wait_unless_newer(self, item: Retained) -> None:
        if not any(item.topic in queue for queue in (self._changes, self._refreshes, self._clearings)):
            self._wait(item)

    def over(self, item: Retained) -> None:
        """Note that an item is no longer under way, acknowledged or dead."""
        self._under_way.discard(item.topic)
        self._burst.discard(item.topic)
        if item is self._closing:
            self._closing = None

    def lost(self) -> None:
        """Forget everything but what clears a topic: the next burst holds it."""
        self._under_way.clear()
        self._burst.clear()
        self._last = self._closing = None
        self._changes.clear()
        self._refreshes.clear()
        self._passed_over = {
            topic: each for topic, each in self._passed_over.items() if each.publication.payload is None
        }

    def put_back(self, item: Retained) -> None:
        """Let a clearing that was under way wait again, unless a newer version does."""
        if item.publication.payload is None:
            self._wait_unless_newer(item)
