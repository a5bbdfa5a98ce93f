"""Finds frames in what was received, through noise, at every offset.

An `ExpectedFrame` is one right answer looked for. Its head (slave id, function, count) is found by a plain search, its
length is known from its shape, so each byte is looked at a fixed number of times however long the garbage is.
Positions count characters from the beginning of the exchange.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from math import inf

from lfs10d.modbus.frames import Codec, Shape
from lfs10d.system.dataclass import dataclass

KEPT = 1024
"""Characters kept while the line babbles: more than twice the longest frame (513, ASCII)."""


@dataclass(slots=True)
class ExpectedFrame:
    """An answer to search for, from position `start` on; `begun` once its whole head was found."""

    codec: Codec
    shape: Shape
    start: int = 0
    begun: bool = False
    partial: bool = False
    """At `start` lies the head of a frame whose rest has not come yet."""
    tail: int = 0
    """How many characters at the very end were the beginning of its head when `tail_of` were end and start."""
    tail_of: tuple[int, int] = (0, 0)

    def skip(self, position: int) -> None:
        """Look for it at `position` and later only."""
        if position > self.start:
            self.start, self.partial = position, False


@dataclass(frozen=True, slots=True)
class FoundFrame:
    """A valid frame: its body without check, its position, and the times of its first and last byte."""

    body: bytes
    begin: int
    end: int
    first_at: float
    last_at: float


class FrameSearch:
    """The stream of one exchange."""

    __slots__ = ("_base", "_claims", "_marks", "_stream", "end")

    def __init__(self) -> None:
        self.end = 0
        """The position behind the last character heard."""
        self._stream = bytearray()
        self._base = 0
        self._marks: list[tuple[int, float]] = []
        """The position behind each piece, and when it was heard."""
        self._claims: list[tuple[int, int]] = []

    def feed(self, data: bytes, now: float) -> None:
        """Add bytes received at `now`; call `seek` for every expected answer before the next call."""
        if self.end - self._base > 2 * KEPT:
            self._forget(self.end - self._base - KEPT)
        self._stream += data
        self.end += len(data)
        self._marks.append((self.end, now))

    def _forget(self, count: int) -> None:
        del self._stream[:count]
        self._base += count
        del self._marks[: self._mark(self._base)]

    def seek(self, expected: ExpectedFrame) -> FoundFrame | None:
        """Return the next valid frame of this shape, or None; the next call goes on behind it."""
        head, size = expected.shape.head, expected.shape.size
        if expected.partial and expected.start + size > self.end:
            return None
        expected.partial = False
        while True:
            at = self._stream.find(head, max(0, expected.start - self._base))
            if at < 0:
                expected.start = max(expected.start, self.end - len(head) + 1)
                return None
            expected.begun = True
            begin = expected.start = self._base + at
            if begin + size > self.end:
                expected.partial = True
                return None
            body = expected.codec.unwrap(bytes(self._stream[at : at + size]))
            if body is not None:
                expected.start = end = begin + size
                last = self._marks[-1] if end == self.end else self._marks[self._mark(end - 1)]
                return FoundFrame(body, begin, end, self._marks[self._mark(begin)][1], last[1])
            expected.start = begin + 1

    def _mark(self, position: int) -> int:
        """Return which piece has the character at this position, the first one being 0."""
        return bisect_right(self._marks, (position, inf))

    def claim(self, found: FoundFrame) -> None:
        """Mark the bytes of a frame as explained."""
        self._claims.append((found.begin, found.end))

    def claimed(self, found: FoundFrame) -> bool:
        """Whether a byte of this frame belongs to a claimed one."""
        return any(found.begin < end and begin < found.end for begin, end in self._claims)

    def unclaimed(self, start: int) -> bytes:
        """Return what was heard from `start` on and belongs to no claimed frame (of the last `KEPT`)."""
        rest = bytearray()
        at = max(start, self._base, self.end - KEPT)
        for begin, end in sorted(self._claims):
            rest += self._stream[at - self._base : max(0, begin - self._base)]
            at = max(at, end)
        return bytes(rest + self._stream[at - self._base :])

    def pieces(self, start: int) -> list[tuple[bytes, float]]:
        """Return what `unclaimed` returns, in pieces, each with the time at which it was read."""
        found: list[tuple[bytes, float]] = []
        at = max(start, self._base, self.end - KEPT)
        for begin, end in [*sorted(self._claims), (self.end, self.end)]:
            while at < begin:
                end_of_piece, heard_at = self._marks[self._mark(at)]
                until = min(begin, end_of_piece)
                found.append((bytes(self._stream[at - self._base : until - self._base]), heard_at))
                at = until
            at = max(at, end)
        return found

    def unclaimed_between(self, start: int, end: int) -> bytes:
        """Return what was heard from `start` to before `end` and belongs to no claimed frame (of the last `KEPT`)."""
        rest = bytearray()
        at = max(start, self._base)
        for begin, behind in [*sorted(self._claims), (end, end)]:
            rest += self._stream[at - self._base : max(0, min(begin, end) - self._base)]
            at = max(at, behind)
        return bytes(rest)

    def unclaimed_count(self, start: int) -> int:
        """Return the number of characters from `start` on that belong to no claimed frame."""
        count = self.end - start
        for begin, end in self._claims:
            if end > start:
                count -= end - max(begin, start)
        return count

    def begins(self, expected: ExpectedFrame) -> bool:
        """Return whether this answer has begun: its head came, or enough of it at the very end."""
        return expected.begun or self._tail(expected) >= expected.shape.sign

    def _tail(self, expected: ExpectedFrame) -> int:
        """Return how many characters at the very end are the beginning of this answer's head."""
        if expected.tail_of != (self.end, expected.start):
            expected.tail_of, expected.tail = (self.end, expected.start), 0
            head = expected.shape.head
            for length in range(min(len(head), self.end - max(expected.start, self._base)), 0, -1):
                if self._stream.endswith(head[:length]):
                    expected.tail = length
                    break
        return expected.tail

    def missing(self, expected_frames: Iterable[ExpectedFrame]) -> int:
        """Return how many characters must still come before any of these can be whole; 0 if none has begun.

        Where one character fits several, the first of them is taken: an answer is likelier than a refusal, and
        a refusal noticed a few characters late costs less than a wake-up in every exchange.
        """
        fewest = 0
        for expected in expected_frames:
            if expected.partial:
                lacking, length = expected.start + expected.shape.size - self.end, len(expected.shape.head)
            elif length := self._tail(expected):
                lacking = expected.shape.size - length
            else:
                continue
            if not fewest or (length > 1 and lacking < fewest):
                fewest = lacking
        return fewest
