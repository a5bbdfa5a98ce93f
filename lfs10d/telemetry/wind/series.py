"""Good values of the last minutes with the times for which they hold, in blocks that are summed up once. Pure.

A value holds until the next one, for at most the time given with it; what is not held is a gap. Times are whole
milliseconds of a clock that never goes back. Values are kept as whole hundred-thousandths of their unit, in 32 bits, as
long as all are such; then as they are, in 64. Whatever the wind does, memory is bounded, which queues of extremes
are not on a long rise or fall.
"""

from __future__ import annotations

from abc import abstractmethod
from array import array
from bisect import bisect_right
from collections.abc import Sequence
from operator import sub
from typing import ClassVar, Final, NamedTuple

BLOCK: Final = 48
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


class Sums(NamedTuple):
    """The milliseconds covered in a span, and two integrals over them."""

    covered: int
    first: float
    second: float

    def plus(self, other: Sums) -> Sums:
        """Return the sums of both spans."""
        return Sums(self.covered + other.covered, self.first + other.first, self.second + other.second)

    def less(self, part: Sums) -> Sums:
        """Return the sums of what is left of a span without a part of it."""
        return Sums(self.covered - part.covered, self.first - part.first, self.second - part.second)


NO_SUMS: Final = Sums(0, 0, 0)


class Edge(NamedTuple):
    """A moment at which windows begin or end, the block in which it lies, and that block's sums before and behind it.

    Of the newest block `behind` is nothing: what begins there ends there too.
    """

    at: int
    block: int
    before: Sums
    behind: Sums


class HeldSeries:
    """Entries in order of time: a good value, or a gap that begins where a value holds no longer.

    The newest block is summed up as it grows, so that a window costs little more than its oldest block.
    """

    __slots__ = (
        "_close_at",
        "_covered",
        "_first",
        "_newest_kept",
        "_open_gaps",
        "_open_sums",
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
        """The sums of each block that is complete."""
        self._empty_open()
        self._newest_kept: float = 0
        """The newest value as it is kept."""
        self._origin = 0
        self._close_at = BLOCK
        """Entries with which the newest block is complete; it is closed when another follows."""
        self.newest = 0
        """When the newest value was measured; 0: there is none."""
        self.held_until = 0
        """When the newest value holds no longer."""

    def add(self, at: int, value: float, hold: int) -> None:
        """Take a good value measured at `at`, which holds for `hold` at most; one before the newest counts as new."""
        newest = self.newest
        if at < newest:  # noqa: PLR1730 - a call would take longer; this is done for each sample
            at = newest
        kept = value
        if self._scale != 1:
            kept = round(value * SCALE)
            if kept / SCALE != value or not -_GREATEST < value < _GREATEST:
                self._keep_as_they_are()
                kept = value
        if self.held_until < at:
            self._resume(at, kept)
        else:
            self._settle(at - newest)
        if len(self._times) == self._close_at:
            self._close_block(at)
        self._times.append(at - self._origin)
        self._values.append(kept)  # type: ignore[arg-type] # whole, where they are
        self.newest = at
        self.held_until = at + hold
        self._newest_kept = kept
        self._took(at, kept)

    def end(self, at: int) -> None:
        """Let the newest value hold no longer than `at`, which is not before it."""
        self.held_until = min(self.held_until, max(at, self.newest))

    def edge(self, at: int) -> Edge:
        """Return a moment at which windows begin or end."""
        at -= self._origin
        last = bisect_right(self._times, at)
        place = max(0, last - 1)
        block = place // BLOCK
        begin = block * BLOCK
        if block == self._closed:
            if last == len(self._times):
                return Edge(at, block, self._open(min(at, self.held_until - self._origin)), NO_SUMS)
            return Edge(at, block, self._sums(*self._held(begin, last, 0, at)), NO_SUMS)
        whole = Sums(self._covered[block], self._first[block], self._second[block])
        if self._scale == 1:  # what is left of a sum has not all digits of its parts
            before = self._sums(*self._held(begin, last, 0, at))
            return Edge(at, block, before, self._sums(*self._held(place, begin + BLOCK, at, _LAST)))
        if last - begin <= BLOCK // 2:
            before = self._sums(*self._held(begin, last, 0, at))
            return Edge(at, block, before, whole.less(before))
        behind = self._sums(*self._held(place, begin + BLOCK, at, _LAST))
        return Edge(at, block, whole.less(behind), behind)

    def between(self, begin: Edge, end: Edge) -> Sums:
        """Return the sums of a window."""
        if end.block == begin.block:
            first = max(0, bisect_right(self._times, begin.at) - 1)
            return self._sums(*self._held(first, bisect_right(self._times, end.at), begin.at, end.at))
        which = slice(begin.block + 1, end.block)
        (covered, one, two), (more, more_one, more_two) = begin.behind, end.before
        return Sums(
            covered + sum(self._covered[which]) + more,
            one + sum(self._first[which]) + more_one,
            two + sum(self._second[which]) + more_two,
        )

    def _keep_as_they_are(self) -> None:
        self._values = array("d", [each if each == GAP else each / SCALE for each in self._values])
        self._newest_kept /= SCALE
        self._scale = 1
        self._scaled_down()

    def _resume(self, at: int, kept: float) -> None:
        """Note the gap before a value; where nothing before it is in any window the series begins with it."""
        if self._times and at - self.reach <= self.held_until:
            self._settle(self.held_until - self.newest)
            if len(self._times) == self._close_at:
                self._close_block(at)
            self._times.append(self.held_until - self._origin)
            self._values.append(GAP)
            self._open_gaps += 1
            self._gap()
        else:
            self._drop(self._closed)
            del self._times[:], self._values[:]
            self._empty_open()
            self._close_at = BLOCK
            self._origin = at
            self._start(kept)

    def _close_block(self, at: int) -> None:
        """Close the block that is complete, and drop what lies before all windows that end at `at` or later.

        The entry that may hold at their beginning stays.
        """
        self._covered.append(self._open_sums.covered)
        self._first.append(self._open_sums.first)
        self._second.append(self._open_sums.second)
        self._close()
        self._empty_open()
        blocks = max(0, bisect_right(self._times, at - self.reach - self._origin) - 1) // BLOCK
        if blocks * BLOCK >= _DROPPED_AT_ONCE:
            self._drop(blocks)
        self._close_at = (self._closed + 1) * BLOCK
        if at - self._origin >= _LATEST:
            oldest = self._times[0]
            self._times = array("I", [each - oldest for each in self._times])
            self._origin += oldest

    # What a window is made of

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
        """The number of blocks that are summed up."""
        return len(self._covered)

    def _drop(self, blocks: int) -> None:
        """Forget the oldest blocks."""
        del self._times[: blocks * BLOCK], self._values[: blocks * BLOCK]
        del self._covered[:blocks], self._first[:blocks], self._second[:blocks]

    def _empty_open(self) -> None:
        """Begin the newest block."""
        self._open_sums = NO_SUMS
        """Its sums, but for its newest value, which holds for an unknown time."""
        self._open_gaps = 0

    def _settle(self, held: int) -> None:
        """Add the newest value to the sums of the newest block: it holds for `held`."""
        self._open_sums = self._open_sums.plus(self._newest(held))

    def _open(self, until: int) -> Sums:
        """Return the sums of the newest block if its newest value holds until then."""
        return self._open_sums.plus(self._newest(until + self._origin - self.newest))

    @abstractmethod
    def _sums(self, values: Sequence[float], held: list[int]) -> Sums:
        """Return the time covered and the integrals of these entries; gaps are among the values."""

    @abstractmethod
    def _newest(self, held: int) -> Sums:
        """Return the sums of the newest value if it holds for `held`."""

    @abstractmethod
    def _took(self, at: int, kept: float) -> None:
        """Note what else is to be known of the newest value."""

    def _gap(self) -> None:
        """Note that the newest entry is a gap, behind the value measured at `newest`."""

    @abstractmethod
    def _close(self) -> None:
        """Note what else is to be known of the block that is closed."""

    def _start(self, kept: float) -> None:
        """Take the first value of a series that begins, as it is kept."""

    def _scaled_down(self) -> None:
        """From now on values are kept as they are: what was in parts of a unit is to be in units."""
