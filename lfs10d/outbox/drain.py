"""The part of the window that `history` may use: the longer the backlog does not shrink, the more. Pure.

At level 1 one batch is under way at a time, and the history has the weight of the live samples. Where the backlog has
not shrunk from one look to the next though batches were full, the level doubles, and with it the weight, up to 8, and a
quarter, a half or all of the window may be batches. Where a batch took all that waited of its device, more would not
carry more, and the level is halved.

Several batches under way fill the buffers of a slow link, and live samples wait behind them: hence no more than needed.
"""

from __future__ import annotations

LEVEL_MOST = 8
"""At this weight three quarters of the messages are batches even where everything else waits too."""

LOOK_EVERY = 5.0
"""Seconds from one look at the backlog to the next, at least."""

LOOK_BATCHES = 4
"""Batches acknowledged between two looks, at least: one more or less must not decide."""


class Drain:
    """The rules above."""

    def __init__(self) -> None:
        self.level = 1
        """1, 2, 4 or 8."""
        self._look_at = float("-inf")
        self._acknowledged = 0
        self._depth: int | None = None
        self._full = False

    def batches(self, window: int) -> int:
        """Return how many batches may be under way where `window` messages may."""
        return 1 if self.level == 1 else max(1, window * self.level // LEVEL_MOST)

    def begin(self, now: float) -> None:
        """Begin at level 1: the backlog was opened."""
        self.level = 1
        self._again(now, None)

    def taken(self, *, full: bool) -> None:
        """Note that a batch was taken; `full`: more of its device waits."""
        self._full = full

    def on_ack(self, now: float) -> bool:
        """Note that a batch is acknowledged; return True if `look` is to follow."""
        self._acknowledged += 1
        return now >= self._look_at and self._acknowledged >= LOOK_BATCHES

    def look(self, now: float, depth: int) -> None:
        """Take how many samples of the backlog wait, and decide."""
        if not self._full:
            self.level = max(1, self.level // 2)
        elif self._depth is not None and depth >= self._depth:
            self.level = min(2 * self.level, LEVEL_MOST)
        self._again(now, depth)

    def _again(self, now: float, depth: int | None) -> None:
        self._look_at = now + LOOK_EVERY
        self._acknowledged = 0
        self._depth = depth
