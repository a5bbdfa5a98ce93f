"""Good values of the last minutes with the times for which they hold, in blocks that are summed up once. Pure.

A value holds until the next one, for at most the time given with it; what is not held is a gap. Times are whole
milliseconds of a clock that never goes back. One value takes 14 bytes: whatever the wind does, memory is bounded, which
queues of extremes are not on a long rise or fall.
"""

from __future__ import annotations

from abc import abstractmethod
from array import array
from bisect import bisect_left, bisect_right
from math import nan
from operator import sub
from typing import Final, NamedTuple

BLOCK: Final = 32
"""Entries that are summed up together: a window has at most two blocks of which only a part lies in it."""

REACH: Final = 720_000
"""Milliseconds that are kept: the last 2 min, and the 10 min before them."""

_DROPPED_AT_ONCE: Final = 4 * BLOCK
_LATEST: Final = 2**31
"""Milliseconds after the first entry's origin at which times are counted from a newer one: they have 32 bits."""


class WindowParts(NamedTuple):
    """The entries of a window: half-open ranges of raw ones, and the whole blocks between them."""

    raw: tuple[tuple[int, int], ...]
    blocks: slice


class HeldSeries:
    """Entries in order of time: a good value, or a gap (not a number) that begins where a value holds no longer."""

    __slots__ = ("_close_at", "_origin", "_times", "_values", "held_until", "newest")

    def __init__(self) -> None:
        self._times = array("I")
        self._values = array("d")
        self._origin = 0
        self._close_at = BLOCK
        """Entries with which the next block is complete, and the entry behind it is not known yet."""
        self.newest = 0
        """When the newest value was measured; 0: there is none."""
        self.held_until = 0
        """When the newest value holds no longer."""

    def add(self, at: int, value: float, hold: int) -> None:
        """Take a good value measured at `at`, which holds for `hold` at most; one before the newest counts as new."""
        at = max(at, self.newest)
        if self.held_until < at:
            self._resume(at, value)
        self._times.append(at - self._origin)
        self._values.append(value)
        self.newest = at
        self.held_until = at + hold
        if len(self._times) > self._close_at:
            self._sum_up(at)

    def end(self, at: int) -> None:
        """Let the newest value hold no longer than `at`, which is not before it."""
        self.held_until = min(self.held_until, max(at, self.newest))

    def _resume(self, at: int, value: float) -> None:
        """Note the gap before a value; where nothing before it is in any window the series begins with it."""
        if self._times and at - REACH <= self.held_until:
            self._times.append(self.held_until - self._origin)
            self._values.append(nan)
            if len(self._times) > self._close_at:
                self._sum_up(at)
        else:
            del self._times[:], self._values[:]
            self._drop(self._closed())
            self._close_at = BLOCK
            self._origin = at
            self._start(value)

    def _sum_up(self, at: int) -> None:
        """Sum up the block that is complete, and drop what lies before all windows that end at `at` or later.

        The entry that may hold at their beginning stays.
        """
        self._close(self._close_at - BLOCK)
        blocks = max(0, bisect_right(self._times, at - REACH - self._origin) - 1) // BLOCK
        if blocks * BLOCK >= _DROPPED_AT_ONCE:
            del self._times[: blocks * BLOCK], self._values[: blocks * BLOCK]
            self._drop(blocks)
        self._close_at = (self._closed() + 1) * BLOCK
        if at - self._origin >= _LATEST:
            oldest = self._times[0]
            self._times = array("I", [each - oldest for each in self._times])
            self._origin += oldest

    # What a window is made of

    def _measured(self, begin: int, end: int) -> WindowParts:
        """Return the entries that begin within [begin, end)."""
        first, last = bisect_left(self._times, begin - self._origin), bisect_left(self._times, end - self._origin)
        return self._parts(first, max(first, last), first, last)

    def _holding(self, begin: int, end: int) -> WindowParts:
        """Return the entries that may hold within [begin, end); only raw ones begin before it or hold beyond it."""
        first = max(0, bisect_right(self._times, begin - self._origin) - 1)
        last = max(first, bisect_left(self._times, end - self._origin))
        return self._parts(first, last, first + 1, last - 1)

    def _parts(self, first: int, last: int, inner_first: int, inner_last: int) -> WindowParts:
        """Return entries `first` to `last` with whole blocks from between `inner_first` and `inner_last`."""
        block, blocks = -(-inner_first // BLOCK), min(inner_last // BLOCK, self._closed())
        if block >= blocks:
            return WindowParts(((first, last),), slice(0, 0))
        return WindowParts(((first, block * BLOCK), (blocks * BLOCK, last)), slice(block, blocks))

    def _held(self, first: int, last: int, begin: int, end: int) -> tuple[list[float], list[int]]:
        """Return these entries, and the milliseconds for which each holds within [begin, end)."""
        bounds = self._times[first : last + 1].tolist()
        if last == len(self._times):
            bounds.append(self.held_until - self._origin)
        begin, end = begin - self._origin, end - self._origin
        if bounds[0] < begin or bounds[-1] > end:
            bounds = [min(max(each, begin), end) for each in bounds]
        return self._values[first:last].tolist(), list(map(sub, bounds[1:], bounds))

    @abstractmethod
    def _closed(self) -> int:
        """Return how many blocks are summed up."""

    @abstractmethod
    def _close(self, first: int) -> None:
        """Sum up the block that begins with entry `first`; the entry behind it is known."""

    @abstractmethod
    def _drop(self, blocks: int) -> None:
        """Forget the sums of the oldest blocks."""

    @abstractmethod
    def _start(self, value: float) -> None:
        """Take the first value of a series that begins."""
