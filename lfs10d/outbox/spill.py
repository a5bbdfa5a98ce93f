"""Decides when samples that wait in memory are written to the store. Pure.

While the broker has been away for more than 3 s, what waits is handed over, at first at once, then every 5 s; and
whenever half of the memory is taken, which happens where the broker is too slow. What the store cannot take waits in
memory.
"""

from __future__ import annotations

from lfs10d.outbox.history import History, QueuedSample
from lfs10d.outbox.recent_acks import RecentAcks
from lfs10d.system.clock_step import ClockState

AWAY_AFTER = 3.0
"""Seconds without the broker after which samples are kept on disk."""

SPILL_EVERY = 5.0
"""Seconds from one commit to the next; and to the next attempt where the store cannot take anything."""

SPILL_MOST = 1000
"""Samples in one commit: about 30 ms of the store's thread."""


class Spill:
    """The rules above for what waits in `history`; `capacity` samples have room there."""

    def __init__(self, history: History, recent: RecentAcks, capacity: int) -> None:
        self.samples: list[QueuedSample] = []
        """The samples being written to the store."""
        self.away = True
        """Whether the broker is there."""
        self._history = history
        self._recent = recent
        self._capacity = capacity
        self._away_since = float("-inf")
        self._due = float("-inf")

    def lost(self, now: float) -> None:
        """Note that the connection is lost."""
        if not self.away:
            self._away_since = now
        self.away = True

    @property
    def at_last(self) -> bool:
        """There is something for the store before the daemon ends."""
        return bool(self._history or (self._recent.repeat and self._recent.waiting))

    def due(self) -> float | None:
        """Return when `take` is wanted for what waits here; None: for nothing."""
        if self.samples:
            return None
        if len(self._history) > self._capacity // 2:
            return self._due
        if not self.away or not self.at_last:
            return None
        return max(self._away_since + AWAY_AFTER, self._due)

    def take(self) -> list[QueuedSample]:
        """Take what the store shall keep; `done` or `failed` is to follow."""
        if self.away:
            self._history.extend(self._recent.take_lost())
        while len(self.samples) < SPILL_MOST and self._history:
            self.samples += self._history.take(SPILL_MOST - len(self.samples))
        return self.samples

    def done(self, now: float) -> None:
        """Note that the store has it."""
        self.samples = []
        self._due = float("-inf") if self._history else now + SPILL_EVERY

    def failed(self, now: float) -> None:
        """Let it wait in memory, since the store cannot take it."""
        self._history.extend(self.samples)
        self.samples = []
        self._due = now + SPILL_EVERY

    def correct(self, shift: int, clock: ClockState) -> None:
        """Give what is being handed over the time that the clock tells now, as `QueuedSample.at` does."""
        self.samples = [queued.at(shift, clock) for queued in self.samples]
