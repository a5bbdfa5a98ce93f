"""Items in flight: sent to the broker, or about to be, and not acknowledged yet. Pure."""

from __future__ import annotations

from collections.abc import Iterator

from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.items import OutboxItem, samples_of
from lfs10d.outbox.suspects import Suspects


class InFlight:
    """At most `window` items in the order in which they were taken; 0: there is no connection.

    An item that `suspects` says goes alone waits here until nothing else is under way.
    """

    def __init__(self, suspects: Suspects) -> None:
        self.window = 0
        self.alone: OutboxItem | None = None
        """The item that goes alone."""
        self._suspects = suspects
        self._since: dict[OutboxItem, float] = {}
        self._alone_went = False

    def __len__(self) -> int:
        return len(self._since)

    def __iter__(self) -> Iterator[OutboxItem]:
        return iter(self._since)

    @property
    def full(self) -> bool:
        """The window has no room."""
        return len(self._since) >= self.window

    @property
    def closed(self) -> bool:
        """Nothing may go before an acknowledgement: the window is full, or an item goes alone."""
        return self.alone is not None or len(self._since) >= self.window

    def begin(self, item: OutboxItem, now: float) -> OutboxItem | None:
        """Take an item at `now`; return it unless it goes alone and has to wait for that."""
        self._since[item] = now
        if not (self._suspects.alone and self._suspects.goes_alone(item.topic)):
            return item
        self.alone, self._alone_went = item, False
        return self.next_alone()

    def next_alone(self) -> OutboxItem | None:
        """Return the item that goes alone as soon as nothing else is under way, once."""
        if self._alone_went or len(self._since) > 1:
            return None
        self._alone_went = True
        return self.alone

    def end(self, item: OutboxItem) -> float:
        """Let an item go: it is acknowledged, refused, or cannot be sent; return when it was taken."""
        since = self._since.pop(item)
        if item is self.alone:
            self.alone = None
        return since

    def replace(self, item: OutboxItem, other: OutboxItem) -> None:
        """Put another item in the place of one."""
        self._since = {other if each is item else each: at for each, at in self._since.items()}
        if self.alone is item:
            self.alone = other

    def lost(self) -> list[OutboxItem]:
        """Return what was under way when the connection was lost, and forget it."""
        items = list(self._since)
        self._since.clear()
        self.alone = None
        self.window = 0
        return items

    def in_memory(self) -> Iterator[tuple[QueuedSample, ...]]:
        """Return the samples under way that are not in the store, item by item: all of one are, or none is."""
        for item in self._since:
            samples = samples_of(item)
            if samples and samples[0].row is None:
                yield samples
