"""Good values of the last minutes with the times for which they hold, in blocks that are summed up once. Pure.

A value holds until the next one, for at most the time given with it; what is not held is a gap. Times are whole
milliseconds of a clock that never goes back. Values are kept as whole hundred-thousandths of their unit, in 32 bits, as
long as all are such; then as they are, in 64. Whatever the wind does, memory is bounded, which queues of extremes
are not on a long rise or fall.
"""

from __future__ import annotations

from abc import abstractmethod
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from operator import sub
from typing import ClassVar, Final, NamedTuple

BLOCK: Final = 32
"""Entries that are summed up together: a window has at most two blocks of which only a part lies in it."""

REACH: Final = 720_000
"""Milliseconds that are kept at most: the last 2 min, and the 10 min before them."""

SCALE: Final = 100_000
"""Parts of a unit in which values are whole numbers."""

GAP: Final = -(2**31)
"""An entry where nothing is held: no value."""

_GREATEST: Final = 20_000
"""Values beyond have no room in 32 bits."""

_LAST: Final = 2**32
"""Later than all times."""

_DROPPED_AT_ONCE: Final = 2 * BLOCK
_LATEST: Final = 2**31
"""Milliseconds after the first entry's origin at which times are counted from a newer one: they have 32 bits."""


class WindowParts(NamedTuple):
    """The entries of a window: half-open ranges of raw ones, and the whole blocks between them."""

    raw: tuple[tuple[int, int], ...]
    blocks: slice


class Sums(NamedTuple):
    """The milliseconds covered in a span, and two integrals over them."""

    covered: float
    first: float
    second: float


class Edge(NamedTuple):
    """A moment, the block in which it lies, and the sums of the part of that block on the window's side of it."""

    at: int
    block: int
    sums: Sums


class HeldSeries:
    """Entries in order of time: a good value, or a gap that begins where a value holds no longer."""

    __slots__ = (
        "_close_at",
        "_covered",
        "_first",
        "_origin",
        "_scale",
        "_second",
        "_times",
        "_values",
        "held_until",
        "newest",
    )

    reach: ClassVar[int] = REACH
    """Milliseconds that are kept."""

    def __init__(self) -> None:
        self._times = array("I")
        self._values: array[int] | array[float] = array("i")
        self._scale = SCALE
        """What values are multiplied with: 1 where they are kept as they are."""
        self._covered, self._first, self._second = array("I"), array("d"), array("d")
        """The sums of each block that is summed up."""
        self._origin = 0
        self._close_at = BLOCK
        """Entries with which the next block is complete, and the entry behind it is not known yet."""
        self.newest = 0
        """When the newest value was measured; 0: there is none."""
        self.held_until = 0
        """When the newest value holds no longer."""

    def add(self, at: int, value: float, hold: int) -> None:
        """Take a good value measured at `at`, which holds for `hold` at most; one before the newest counts as new."""
        if at < self.newest:  # noqa: PLR1730 - a call would take longer; this is done for each sample
            at = self.newest
        kept = value
        if self._scale != 1:
            kept = round(value * SCALE)
            if kept / SCALE != value or not -_GREATEST < value < _GREATEST:
                self._keep_as_they_are()
                kept = value
        if self.held_until < at:
            self._resume(at, kept)
        self._times.append(at - self._origin)
        self._values.append(kept)  # type: ignore[arg-type] # whole, where they are
        self.newest = at
        self.held_until = at + hold
        if len(self._times) > self._close_at:
            self._sum_up(at)

    def end(self, at: int) -> None:
        """Let the newest value hold no longer than `at`, which is not before it."""
        self.held_until = min(self.held_until, max(at, self.newest))

    def begin(self, at: int) -> Edge:
        """Return the beginning of windows: what lies behind `at` in its block."""
        at -= self._origin
        place = max(0, bisect_right(self._times, at) - 1)
        block = place // BLOCK
        last = min((block + 1) * BLOCK, len(self._times))
        return Edge(at, block, self._sums(*self._held(place, last, at, _LAST)))

    def until(self, at: int) -> Edge:
        """Return the end of windows: what lies before `at` in its block."""
        at -= self._origin
        last = bisect_right(self._times, at)
        block = max(0, last - 1) // BLOCK
        return Edge(at, block, self._sums(*self._held(block * BLOCK, last, 0, at)))

    def between(self, begin: Edge, end: Edge) -> Sums:
        """Return the sums of a window."""
        if end.block == begin.block:
            first = max(0, bisect_right(self._times, begin.at) - 1)
            return self._sums(*self._held(first, bisect_right(self._times, end.at), begin.at, end.at))
        which = slice(begin.block + 1, end.block)
        (covered, one, two), (more, more_one, more_two) = begin.sums, end.sums
        return Sums(
            covered + sum(self._covered[which]) + more,
            one + sum(self._first[which]) + more_one,
            two + sum(self._second[which]) + more_two,
        )

    def _keep_as_they_are(self) -> None:
        self._values = array("d", [each if each == GAP else each / SCALE for each in self._values])
        self._scale = 1
        self._scaled_down()

    def _resume(self, at: int, kept: float) -> None:
        """Note the gap before a value; where nothing before it is in any window the series begins with it."""
        if self._times and at - self.reach <= self.held_until:
            self._times.append(self.held_until - self._origin)
            self._values.append(GAP)
            if len(self._times) > self._close_at:
                self._sum_up(at)
        else:
            self._drop(self._closed)
            del self._times[:], self._values[:]
            self._close_at = BLOCK
            self._origin = at
            self._start(kept)

    def _sum_up(self, at: int) -> None:
        """Sum up the block that is complete, and drop what lies before all windows that end at `at` or later.

        The entry that may hold at their beginning stays.
        """
        first = self._close_at - BLOCK
        sums = self._sums(*self._held(first, first + BLOCK, 0, _LAST))
        self._covered.append(int(sums.covered))
        self._first.append(sums.first)
        self._second.append(sums.second)
        self._close(first)
        blocks = max(0, bisect_right(self._times, at - self.reach - self._origin) - 1) // BLOCK
        if blocks * BLOCK >= _DROPPED_AT_ONCE:
            self._drop(blocks)
        self._close_at = (self._closed + 1) * BLOCK
        if at - self._origin >= _LATEST:
            oldest = self._times[0]
            self._times = array("I", [each - oldest for each in self._times])
            self._origin += oldest

    # What a window is made of

    def _measured(self, begin: int, end: int) -> WindowParts:
        """Return the entries that begin within [begin, end)."""
        first = bisect_left(self._times, begin - self._origin)
        last = max(first, bisect_left(self._times, end - self._origin))
        block, blocks = -(-first // BLOCK), min(last // BLOCK, self._closed)
        if block >= blocks:
            return WindowParts(((first, last),), slice(0, 0))
        return WindowParts(((first, block * BLOCK), (blocks * BLOCK, last)), slice(block, blocks))

    def _held(self, first: int, last: int, begin: int, end: int) -> tuple[list[int] | list[float], list[int]]:
        """Return these entries, and the milliseconds for which each holds within [begin, end), counted from the origin.

        Only the first may begin before that, and only the last hold beyond it.
        """
        if first >= last:
            return [], []
        bounds = self._times[first : last + 1].tolist()
        if last == len(self._times):
            bounds.append(self.held_until - self._origin)
        bounds[0] = max(bounds[0], begin)
        bounds[-1] = max(bounds[0], min(bounds[-1], end))
        return self._values[first:last].tolist(), list(map(sub, bounds[1:], bounds))

    @property
    def _closed(self) -> int:
        """How many blocks are summed up."""
        return len(self._covered)

    def _drop(self, blocks: int) -> None:
        """Forget the oldest blocks."""
        del self._times[: blocks * BLOCK], self._values[: blocks * BLOCK]
        del self._covered[:blocks], self._first[:blocks], self._second[:blocks]

    @abstractmethod
    def _sums(self, values: Sequence[float], held: list[int]) -> Sums:
        """Return the time covered and the integrals of these entries; gaps are among the values."""

    @abstractmethod
    def _close(self, first: int) -> None:
        """Note what else is to be known of the block that begins with entry `first`."""

    @abstractmethod
    def _start(self, kept: float) -> None:
        """Take the first value of a series that begins, as it is kept."""

    @abstractmethod
    def _scaled_down(self) -> None:
        """From now on values are kept as they are: what was in parts of a unit is to be in units."""
