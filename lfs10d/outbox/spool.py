"""The part of the backlog that is in the store, as the outbox sees it: rows to read and rows to delete. Pure.

What is in the store is older than what waits in memory, so it goes first: a page is taken into memory, leaves in
batches, and is followed by the next. A row stays in the store until its batch is acknowledged, and 10 s longer: if
the connection is lost in that time it is read and sent once more. Nothing of a page is put back after a loss.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import field
from itertools import islice

from lfs10d.outbox.history import History, QueuedSample
from lfs10d.outbox.recent_acks import AGAIN_WITHIN
from lfs10d.outbox.store.sample_file import StoredRow
from lfs10d.system.dataclass import dataclass

PAGE_ROWS = 3200
"""Samples of a page: for up to 32 devices its batches are full."""

RELEASE_EVERY = 5.0
"""Seconds between two deletions."""

RELEASE_MOST = 2000
"""Rows of one deletion: 10 ms of the store's thread."""


@dataclass(slots=True)
class Spool:
    """`rows` and `oldest_ts` are as the store last reported; `page` is what was taken from it and waits."""

    rows: int = 0
    oldest_ts: int | None = None
    more: bool = False
    """Whether there are rows after the page."""
    page: History = field(default_factory=History)
    after: int = 0
    """The id of the last row that was taken."""
    turn: int = 0
    """Counts the rewinds: a page asked for before one is of no use after it."""
    left: bool = False
    """Rows before `after` were passed over: they are neither in the page nor under way."""
    _acknowledged: deque[tuple[float, tuple[int, ...]]] = field(default_factory=deque)
    _again: set[int] = field(default_factory=set)
    _released: set[int] = field(default_factory=set)
    _release_at: float = float("-inf")
    _taken: frozenset[int] = frozenset()
    """Rows that need not be read again before `rewind`."""

    @property
    def depth(self) -> int:
        """Rows that wait or are under way."""
        return max(0, self.rows - len(self._released) - sum(len(rows) for _, rows in self._acknowledged))

    @property
    def delivered(self) -> frozenset[int]:
        """Rows that the broker has acknowledged: if they go it is no loss."""
        lately = (row for _, rows in self._acknowledged for row in rows)
        return frozenset((*self._released, *self._again, *lately))

    def update(self, rows: int, oldest_ts: int | None) -> None:
        """Take what the store says of itself."""
        self.rows, self.oldest_ts = rows, oldest_ts

    def oldest(self) -> int | None:
        """Return the `ts` of the oldest that waits, None where none waits."""
        first = self.page.oldest()
        if first is not None:
            return first.sample.ts
        return self.oldest_ts if self.depth else None

    # In

    def take_page(self, rows: Sequence[StoredRow], most: int) -> None:
        """Take the rows that follow the page before; fewer than `most` are the last."""
        self.more = len(rows) >= most
        for row in rows:
            self.after = row.id
            if row.id not in self._released and row.id not in self._taken:
                repeated = row.repeated or row.id in self._again
                self.page.add(QueuedSample(row.sample, 0.0, repeated, row.shift, row.id))

    def rewind(self) -> None:
        """Forget the page, and begin with the oldest row again: the connection is lost."""
        newest = self._acknowledged[-1][0] if self._acknowledged else 0.0
        self.forget(newest - AGAIN_WITHIN)
        for _, rows in self._acknowledged:
            self._again.update(rows)
        self._acknowledged.clear()
        self._begin(frozenset())

    def _begin(self, taken: frozenset[int]) -> None:
        self._taken = taken
        self.left = False
        self.page.clear()
        self.after = 0
        self.more = self.rows > 0
        self.turn += 1

    def leave(self) -> None:
        """Pass over what is left of the page: the broker refuses it for now. It stays in the store."""
        self.page.clear()
        self.left = True

    def read_again(self, under_way: Iterable[int]) -> None:
        """Begin with the oldest row again if any was passed over; what the broker has or is getting is left out."""
        if self.left:
            lately = (row for _, rows in self._acknowledged for row in rows)
            self._begin(frozenset((*under_way, *lately)))

    # Out

    def on_ack(self, rows: Iterable[int], now: float) -> None:
        """Note that the broker has these."""
        self._acknowledged.append((now, tuple(rows)))

    def release(self, rows: Iterable[int]) -> None:
        """Release these: they may be deleted from the store."""
        self._released.update(rows)

    def forget(self, before: float) -> None:
        """Release what was acknowledged until then."""
        while self._acknowledged and self._acknowledged[0][0] <= before:
            self._released.update(self._acknowledged.popleft()[1])

    def release_all(self) -> None:
        """Release all that was acknowledged: a clean disconnect."""
        self.forget(float("inf"))

    @property
    def letting_go(self) -> bool:
        """There are rows to be deleted whatever the time is."""
        return bool(self._released)

    def release_due(self) -> float | None:
        """Return when there is something to delete; None: nothing."""
        if self._released:
            return self._release_at
        return max(self._release_at, self._acknowledged[0][0] + AGAIN_WITHIN) if self._acknowledged else None

    def releasing(self, now: float) -> frozenset[int]:
        """Return what is to be deleted now; `deleted` is to follow."""
        self.forget(now - AGAIN_WITHIN)
        rows = frozenset(islice(self._released, RELEASE_MOST))
        self._release_at = now if len(rows) < len(self._released) else now + RELEASE_EVERY
        return rows

    def deleted(self, rows: frozenset[int]) -> None:
        """Note that the store has let these go."""
        self._released -= rows
        self._again -= rows
