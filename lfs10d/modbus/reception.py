"""Sorts what was received during one exchange: echo, too early, late answers, the answer, the rest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf

from lfs10d.modbus.ask import Ask, LineContext
from lfs10d.modbus.echo import Echo
from lfs10d.modbus.frame_search import ExpectedFrame, FoundFrame, FrameSearch
from lfs10d.modbus.frames import EXCEPTION_FLAG, Framing, Shape
from lfs10d.modbus.late_answers import find_late_answers
from lfs10d.modbus.outcome import LateAnswer
from lfs10d.modbus.pending import Pending
from lfs10d.modbus.request import BROADCAST, ReadRegisters

HEARD_KEPT = 1024
"""Most bytes remembered as received; the longest frame has 513 (ASCII)."""

EARLY_TOLERANCE = 1
"""Tolerance in characters for an answer that seems to begin before our request has left."""

REQUEST_BODY = 6
"""Slave id, function and two words: what a master sends that reads registers or writes one."""

RATE_TOLERANCE = 0.9
"""A character takes at least this share of its time: rates differ by a few percent, and stop bits are cut."""


class Reception:
    """What one exchange, which sends `frame` and is answered by frames like `answers`, has received so far.

    `answer` is the right frame, once it is whole; `spare` a right frame that came too early to be believed at
    once, on a port without pace; `displaced` a right frame that may answer another master's request to the asked
    slave, which was heard. `late_at` is when the asked slave's last late answer was whole, `whole_at` when
    the frame in progress can be whole.
    """

    def __init__(
        self,
        ask: Ask,
        line: LineContext,
        pending: Mapping[int, tuple[Pending, ...]],
        frame: bytes,
        answers: tuple[Shape, Shape],
    ) -> None:
        self._ask = ask
        self._line = line
        self._pending_by_slave = pending
        earlier = pending.get(ask.request.slave, ())
        self._frame = frame
        self._search = FrameSearch()
        self._normal = ExpectedFrame(ask.codec, answers[0])
        self._exception = ExpectedFrame(ask.codec, answers[1])
        self._reads = isinstance(ask.request, ReadRegisters)
        self._ascii = ask.codec.framing is Framing.ASCII
        self._older = [older for each in earlier for older in self._expected_of(each)] if earlier else []
        self._pending = list(earlier)
        self._held: list[tuple[bytes, float]] = []
        self._matched = self._missing = self._from = self._sent_at = self._early_end = 0
        self._earliest = -inf
        self.sent_yet = self._undecided = self._echo_whole = self._owes_another = self._plain = False
        # Echo and answer of a write look the same.
        self._expects_echo = line.echo is Echo.ON or (line.echo is Echo.UNKNOWN and not self._reads)
        self.heard = bytearray()
        self.answer: FoundFrame | None = None
        self.spare: FoundFrame | None = None
        self.displaced: FoundFrame | None = None
        self.late: list[LateAnswer] = []
        self.late_at = self.whole_at = -inf

    def _expected_of(self, pending: Pending) -> Iterator[tuple[Pending, ExpectedFrame]]:
        """Yield the answers to an earlier request that cannot be taken for ours."""
        ours = {self._normal.shape, self._exception.shape}
        for shape in pending.codec.shapes(pending.request):
            if shape not in ours:
                yield pending, ExpectedFrame(pending.codec, shape)

    def sent(self, begun: float) -> None:
        """Note when the request was begun: from now on its echo and its answer may come."""
        timing = self._line.timing
        self._earliest = begun + timing.transmission(len(self._frame) - EARLY_TOLERANCE)
        self._undecided = self._line.echo is not Echo.OFF
        self._plain = not (self._undecided or self._older or self._ascii or self._ask.request.slave == BROADCAST)
        self._sent_at = self._early_end = heard_before = self._search.end
        if heard_before:
            self._owes_another = self._foreign(0, heard_before, unanswered=True)
            self._begin_at(heard_before)
            self.heard.clear()
        self.sent_yet = True

    def foreseen(self, data: bytes, now: float) -> bool:
        """Return whether `data`, read at `now`, is plainly the beginning of the answer: then it may be sorted later."""
        shape, lacking = self._normal.shape, self._normal.shape.size - len(data)
        begins = shape.head.startswith(data) or (data.startswith(shape.head) and lacking > 0)
        if not (self._plain and begins) or self.heard or self._too_early(len(data), now):
            return False
        self.whole_at, self._missing = now + lacking * self._line.timing.character, lacking
        return True

    def take(self, data: bytes, now: float, after: tuple[bytes, float] | None = None) -> None:
        """Sort what was read at `now`; `after` is what was foreseen before, and when."""
        if after is not None:
            self.heard += after[0]
            self._search.feed(*after)
        self.heard += data
        if len(self.heard) > 2 * HEARD_KEPT:
            del self.heard[:-HEARD_KEPT]
        if self._ascii:
            data = self._ask.codec.fold(data)
        if self._undecided:
            data = self._compare(data, now)
        if data:
            self._sort(data, now)
        if self.answer is None:
            self._foresee(now)

    def _compare(self, data: bytes, now: float) -> bytes:
        """Hold back bytes that may be echo; return the others."""
        part = data[: len(self._frame) - self._matched]
        if not self._frame.startswith(part, self._matched):
            self._undecided = False
            for held, at in self._held:
                self._sort(held, at)
            self._held.clear()
            return data
        self._matched += len(part)
        if self._matched < len(self._frame):
            self._held.append((part, now))
            return b""
        self._undecided, self._echo_whole = False, True
        self._held.clear()
        return data[len(part) :]

    def _sort(self, data: bytes, now: float) -> None:
        early = self._too_early(len(data), now) if self.sent_yet and (self._line.paced or now < self._earliest) else 0
        if early:
            if self._plain:
                self._seek_ours()  # in what was foreseen, which was in time
            self._early_end = self._search.end + early
            if self._line.paced:
                self._begin_at(self._early_end)
        self._search.feed(data, now)
        if self._older:
            self._seek_older(now)
        if self.sent_yet and self._ask.request.slave != BROADCAST:
            self._seek_ours()

    def _begin_at(self, position: int) -> None:
        self._from = position
        self._normal.skip(position)
        self._exception.skip(position)

    def _too_early(self, count: int, now: float) -> int:
        """Return how many of `count` characters read at `now` came before our request can have left the wire.

        On a wire the last but n cannot have come later than n characters ago, however long the adapter kept it.
        """
        if now < self._earliest:
            return count
        room = (now - self._earliest) / (RATE_TOLERANCE * self._line.timing.character)
        return max(0, count - 1 - int(room))

    def _seek_older(self, now: float) -> None:
        """Drop the slave's answers to earlier requests; since it answers in order, none older can follow them."""
        for pending, expected in tuple(self._older):
            if pending not in self._pending or (found := self._search.seek(expected)) is None:
                continue
            self._search.claim(found)
            for other in (self._normal, self._exception, *(other for _, other in self._older)):
                other.skip(found.end)
            del self._pending[: self._pending.index(pending) + 1]
            self._older = [older for older in self._older if older[0] in self._pending]
            latency = max(0.0, found.first_at - pending.sent_end)
            self.late.append(LateAnswer(pending.request, latency, pending.ours))
            self.late_at = now

    def look_elsewhere(self) -> None:
        """Drop the late answers of other slaves too; called once, at the end: they can be many and come seldom."""
        if self._pending_by_slave and self.unsolicited:
            others = {slave: each for slave, each in self._pending_by_slave.items() if slave != self._ask.request.slave}
            self.late += find_late_answers(self._search, others)

    def _seek_ours(self) -> None:
        expected_frames = [self._normal, self._exception]
        if self._expects_echo and not self._echo_whole and not self._reads:
            del expected_frames[0]
        for expected in expected_frames:
            while self.answer is None and (found := self._search.seek(expected)) is not None:
                between = found.begin > self._sent_at
                foreign = self._owes_another or (between and self._foreign(self._sent_at, found.begin))
                self._search.claim(found)
                if foreign:
                    self.displaced = found
                    return
                if found.begin < self._early_end:
                    self.spare = self.spare or found
                else:
                    self.answer = found

    def _foreign(self, start: int, end: int, *, unanswered: bool = False) -> bool:
        """Whether another master was heard asking the asked slave between two positions; for a read only.

        `unanswered`: and the slave was not heard to answer it. What equals our own request counts as its echo, once,
        unless it is known that the adapter has none.
        """
        ask = self._ask
        if not self._reads or end - start < ask.codec.size(REQUEST_BODY):
            return False
        heard = self._search.unclaimed_between(start, end)
        if self.sent_yet and self._echo_possible:
            heard = heard.replace(self._frame, b"", 1)
        found = False
        for _, _, body in ask.codec.frames(heard, ask.request.slave, 0):
            if body[0] == ask.request.slave:
                asks = len(body) == REQUEST_BODY and not body[1] & EXCEPTION_FLAG
                found = asks or (found and not unanswered)
        return found

    def _foresee(self, now: float) -> None:
        """Estimate when the frame in progress can be complete at the earliest."""
        if self._held:
            missing = len(self._frame) - self._matched if self._line.echo is Echo.ON else 0
        else:
            older = [expected for _, expected in self._older] if self._older else []
            missing = self._search.missing([self._normal, self._exception, *older])
        expected = now + missing * self._line.timing.character
        self.whole_at = min(self.whole_at, expected) if 0 < missing < self._missing else expected
        self._missing = missing

    # -- what it amounts to

    @property
    def rest(self) -> int:
        """How many characters came in the place of an answer and are neither echo nor an earlier answer."""
        return self._search.unclaimed_count(self._from) + (self._held_count() if self._held else 0)

    def _held_count(self) -> int:
        return sum(len(held) for held, _ in self._held)

    def leftover(self) -> bytes:
        """Return these characters (the last of them where there were very many)."""
        return self._search.unclaimed(self._from) + b"".join(held for held, _ in self._held)

    @property
    def strays(self) -> tuple[tuple[bytes, float], ...]:
        """What belongs to no echo and to no answer, in pieces, with the times at which they were read."""
        if self._echo_possible:
            own = Shape(self._frame, len(self._frame), len(self._frame))
            echo = self._search.seek(ExpectedFrame(self._ask.codec, own, self._sent_at))
            if echo is not None:
                self._search.claim(echo)
        return tuple(self._search.pieces(0))

    @property
    def _echo_possible(self) -> bool:
        """Whether our own request among what was heard may be its echo: none was found, and there may be one."""
        proved = self._line.echo is Echo.OFF and self._line.echo_proved
        return not (self._echo_whole or proved)

    @property
    def begun(self) -> bool:
        """Whether bytes came that begin as the answer."""
        if self.answer or self.spare or self._search.begins(self._normal) or self._search.begins(self._exception):
            return True
        return not self._expects_echo and self._matched >= self._normal.shape.sign and bool(self._held)

    @property
    def expected(self) -> int:
        """How many characters the answer has that came, as far as can be told."""
        only_exception = self._search.begins(self._exception) and not self._search.begins(self._normal)
        return (self._exception if only_exception else self._normal).shape.size

    @property
    def only_request(self) -> bool:
        """Whether nothing came but our own bytes."""
        return self._ask.codec.fold(bytes(self.heard)) == self._frame

    @property
    def echo_changed(self) -> bool:
        """Whether an echo was expected, and something came in its place."""
        expected = self._expects_echo and not self._echo_whole
        return expected and (bool(self._held) or self._search.unclaimed_count(self._sent_at) > 0)

    @property
    def echoed(self) -> bool | None:
        """Whether our own bytes came back; None without evidence, for only an answer proves that they did not."""
        caught = self.answer or self.spare
        if self._echo_whole:
            return None if not self._reads and self._line.echo is Echo.UNKNOWN and caught is None else True
        if caught is None or not self._reads:
            return None
        heard = self._ask.codec.fold(bytes(self.heard))
        if self._frame in heard:
            return True if heard.startswith(self._frame) else None
        return False

    @property
    def ambiguous(self) -> bool:
        """Whether the answer may be that of another earlier request.

        An exception tells nothing but the function. Where the same was asked before, either answer will do.
        """
        caught = self.answer or self.spare
        if caught is None or not self._pending:
            return False
        request = self._ask.request
        rivals = [each.request for each in self._pending if each.request.slave == request.slave]
        if caught.body[1] & EXCEPTION_FLAG:
            return any(rival.function == request.function for rival in rivals)
        shapes = self._ask.codec.shapes
        return any(rival != request and shapes(rival)[0] == self._normal.shape for rival in rivals)

    @property
    def unsolicited(self) -> int:
        """How many bytes are no echo and belong to no answer, of this or of an earlier request."""
        count = self._search.unclaimed_count(0) + (self._held_count() if self._held else 0)
        if self.answer is None and self.spare is None and self.displaced is None and self.begun:
            count -= min(self.rest, self.expected)
        return count
