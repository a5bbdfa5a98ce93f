"""The requests that may still be answered, kept so that a late answer is not taken for the next one.

Modbus RTU has no transaction id, and no waiting time proves that a late answer will not come. So a request that got
no answer stays here until its slave has answered something that can only be newer, for a slave answers in order.

Rules
-----
1. No answer, or bytes that do not begin as one: the request stays pending. While a pending request has the *shape*
   (function and length of the answer) of another, that other must not be asked for its value: either answer would
   do. A read of another shape goes first, the *barrier*.
2. An answer belongs to the oldest pending request of its shape, if there is one, else to the request just asked.
   What is older is over; what is newer stays pending, the request just asked included. So an answer of a shape that
   nobody was waiting for proves that nothing is pending.
3. Bytes that only begin as an answer end the oldest pending request, whatever its shape.
4. An exception looks the same for every shape. While a request of its function is pending it may be that one's: then
   the slave is left alone for twice its time-out, at least 1 s, after which nothing counts as pending. So is a slave
   whose profile has no second shape.
5. A request met by silence *lingers* for as long, though what was asked later is answered: a bridge or a buffer on
   the way may bring answers out of turn. Until then its shape is not asked for a value.
6. After an exception that does not end it (05, 0A, 0B: a gateway's target may answer later) a request stays pending as
   after silence, and what is older too.
7. Another master's request that was heard is pending too, until its answer is heard: the slave owes it.
   Where it asks in a rhythm ours waits for the pause (`lfs10d.modbus.other_master`).
8. What a slave was asked at another rate is over once it has been silent for `OTHER_RATE`: it hears at one rate only.
9. A slave that is answered for twice is left alone until the second answer has come (`lfs10d.modbus.duplicates`).
"""

from __future__ import annotations

from collections.abc import Iterable

from lfs10d.modbus.duplicates import Duplicates
from lfs10d.modbus.frames import Codec
from lfs10d.modbus.other_master import OtherMaster
from lfs10d.modbus.outcome import LateAnswer, Outcome
from lfs10d.modbus.request import NOT_FINAL, ReadRegisters, Request
from lfs10d.reading import FaultCode
from lfs10d.system.dataclass import dataclass

QUIET_LEAST = 1.0
"""Shortest time in s for which a slave is left alone if no barrier can prove anything."""
_SILENT = frozenset({FaultCode.TIMEOUT, FaultCode.LATE, FaultCode.WRONG_SLAVE})
"""Faults with which the slave itself sent nothing."""
OTHER_RATE = 0.9
"""Seconds; a scan waits a little longer for the last id of a round before the next rate."""
EQUALS_KEPT = 16
"""Of equal pending requests so many are remembered, the newest: more than any sensor keeps in mind. The answer of one
forgotten too soon would count as that of the next, and whatever was asked between the two as answered."""


@dataclass(frozen=True, slots=True)
class Pending:
    """An unanswered earlier request, whose answer may still come; `sent_end` is its last bit.

    `ours`: we asked it, no other master did. `baudrate` is the rate at which it was asked, None where that
    is not known.
    """

    request: Request
    codec: Codec
    sent_end: float
    ours: bool = True
    baudrate: int | None = None


class PendingRequests:
    """The unanswered requests of one line, by slave id.

    `tardy` are the slaves of which an answer has ever come after its time, whoever was asked meanwhile; `barrier_first`
    those whose next poll is preceded by the barrier, which proves what was answered before.
    """

    def __init__(self) -> None:
        self.tardy: set[int] = set()
        self.barrier_first: set[int] = set()
        self.by_slave: dict[int, tuple[Pending, ...]] = {}
        """The requests of every slave id whose answers may still come, each slave's oldest first; for others a view."""
        self._lingers: dict[Pending, float] = {}
        self._over: set[Pending] = set()
        self._quiet_until: dict[int, float] = {}
        self._baudrate: int | None = None
        self.duplicates = Duplicates()
        self.other_master = OtherMaster()

    def earlier(self, slave: int) -> tuple[Pending, ...]:
        """Return the requests to `slave` whose answers may still come, the oldest first."""
        return self.by_slave.get(slave, ())

    def begin(self, slave: int, baudrate: int, now: float) -> None:
        """Note that an exchange with `slave` begins at this rate: what it was asked at another may be over (rule 8)."""
        self._baudrate = baudrate
        for each in self.by_slave.get(slave, ()):
            if each.baudrate not in (None, baudrate) and now >= each.sent_end + OTHER_RATE:
                self._lingers.pop(each, None)
                self._drop(slave, [each], now)

    def owes_besides(self, slave: int, sent_end: float) -> bool:
        """Whether a slave may still answer another request than the one whose last bit left at `sent_end`."""
        return any(each.sent_end != sent_end for each in self.earlier(slave))

    def next_request(
        self,
        request: Request,
        codec: Codec,
        now: float,
        *,
        barrier: ReadRegisters | None,
        timeout: float,
        barrier_first: bool = False,
    ) -> Request | float:
        """Return what to ask so that no answer is mistaken: the request, the barrier, or until when to wait.

        `barrier` is a read of another shape, if the slave has one. `timeout` is the slave's, in s. A write is always
        read back afterwards, so its own answer may be mistaken.
        """
        slave = request.slave
        until = self.left_alone_until(slave, now)
        if until is not None:
            return until
        owes = slave in self.by_slave
        confusable = owes and isinstance(request, ReadRegisters) and self.confusable(request, codec)
        if barrier is not None and (barrier_first or confusable) and self._tells(barrier, request, codec):
            return barrier
        if confusable:
            self.leave_alone(slave, timeout)
            until = self.left_alone_until(slave, now)
            if until is not None:
                return until
        until = self.lingering_until(request, codec, now) if owes else None
        return request if until is None else until

    def _tells(self, barrier: ReadRegisters, request: Request, codec: Codec) -> bool:
        """Whether the answer to the barrier can be told from those to `request` and to what else is pending of ours."""
        shape = codec.shapes(barrier)[0]
        others = [each for each in self.by_slave.get(request.slave, ()) if each.ours and each.request != barrier]
        return shape != codec.shapes(request)[0] and all(
            each in self._over or shape != each.codec.shapes(each.request)[0] for each in others
        )

    def confusable(self, request: Request, codec: Codec) -> bool:
        """Whether an answer to an older request could pass for that to `request`, unless a barrier goes first."""
        pending = self.by_slave.get(request.slave)
        return pending is not None and any(each not in self._over and _alike(request, codec, each) for each in pending)

    def lingering_until(self, request: Request, codec: Codec, now: float) -> float | None:
        """Return until when `request` must not be asked though a barrier was answered (rule 5), None if it may be."""
        pending = self.by_slave.get(request.slave)
        if pending is None:
            return None
        self._drop(request.slave, [each for each in pending if each in self._over], now)
        alike = [each for each in self.earlier(request.slave) if _alike(request, codec, each)]
        return max((self._lingers[each] for each in alike if each in self._over), default=None)

    def leave_alone(self, slave: int, timeout: float) -> None:
        """Decide that no barrier helps for `slave`, whose time-out is `timeout` s: rule 4."""
        sent = max(pending.sent_end for pending in self.by_slave[slave])
        self._quiet_until[slave] = sent + max(2 * timeout, QUIET_LEAST)

    def left_alone_until(self, slave: int, now: float) -> float | None:
        """Return until when `slave` must be left alone, None if it may be asked now."""
        until = self._quiet_until.get(slave)
        if until is not None and now >= until:
            for each in self.by_slave.pop(slave, ()):
                self._forget(each)
            del self._quiet_until[slave]
            until = None
        rests = self.duplicates.rests_until(slave, now)
        busy = self.other_master.busy_until(slave, now) if self.other_master.slaves else None
        if until is rests is busy is None:
            return None
        return max(each for each in (until, rests, busy) if each is not None)

    def asked_by_another(self, request: Request, codec: Codec, now: float) -> None:
        """Note that another master's request was heard, whole at `now`."""
        self._remember(Pending(request, codec, now, ours=False), lingers=None)
        self.other_master.asked(request.slave, now)

    def overheard(self, slave: int, frame: int, *, exception: int | None, now: float) -> bool:
        """Note a right answer of `slave`, of `frame` characters, which is none to us; whether it owed one.

        What another master asked is answered by it, but for exceptions that do not end it (rule 6). While one asks, it
        may have asked more than was heard.
        """
        owed = False
        for each in self.earlier(slave):
            fits = each.codec.shapes(each.request)[exception is not None].size == frame
            if fits and not each.ours:
                if exception in NOT_FINAL:
                    self._lingers[each] = now + QUIET_LEAST
                else:
                    self._drop(slave, [each], now)
                self.other_master.answered(slave, now)
                return True
            owed = owed or fits or not each.ours
        return owed

    def abandoned(self, request: Request, codec: Codec, timeout: float, now: float) -> None:
        """Note that the exchange of `request` was cut off at `now`: it may have been sent."""
        if request.slave:
            self._remember(Pending(request, codec, now), lingers=now + max(2 * timeout, QUIET_LEAST))

    def unanswered(self, request: Request, codec: Codec, sent_end: float) -> None:
        """Note that what answered a request, whose last bit left at `sent_end`, may have been another's answer."""
        self._remember(Pending(request, codec, sent_end), lingers=None)

    def on_outcome(self, outcome: Outcome, codec: Codec, timeout: float, now: float) -> None:
        """Learn from an exchange that is over at `now`; `timeout` in s is the one it had."""
        slave = outcome.request.slave
        for late in outcome.late:
            self._came_late(late, now)
        pending = self.by_slave.get(slave, ())
        if outcome.sent_end is None or slave == 0 or (outcome.answer is not None and not pending):
            return
        asked = Pending(outcome.request, codec, outcome.sent_end, baudrate=self._baudrate)
        if outcome.may_follow:
            self._remember(asked, lingers=asked.sent_end + max(2 * timeout, QUIET_LEAST))
        elif outcome.answer is None and not outcome.answered:
            silent = outcome.fault is not None and outcome.fault.code in _SILENT
            self._remember(asked, lingers=asked.sent_end + max(2 * timeout, QUIET_LEAST) if silent else None)
        elif outcome.ambiguous and outcome.answer is None:
            self._remember(asked, lingers=None)
            self.leave_alone(slave, timeout)
        elif pending:
            over = _over_by(outcome, codec, pending)
            self._drop(slave, pending[:over], now)
            if over < len(pending) or _alike(asked.request, codec, pending[over - 1]):
                self._remember(asked, lingers=None)

    def _came_late(self, late: LateAnswer, now: float) -> None:
        """Drop the request and, since a slave answers in order, what its slave was asked before."""
        slave = late.request.slave
        if late.ours:
            self.tardy.add(slave)
        pending = self.by_slave.get(slave, ())
        for place, each in enumerate(pending):
            if each.request == late.request:
                self._lingers.pop(each, None)
                self._drop(slave, pending[: place + 1], now)
                return

    def _remember(self, asked: Pending, lingers: float | None) -> None:
        slave = asked.request.slave
        pending = self.by_slave.get(slave, ())
        equals = [each for each in pending if each.request == asked.request]
        if len(equals) >= EQUALS_KEPT:
            self._forget(equals[0])
            pending = tuple(each for each in pending if each is not equals[0])
        self.by_slave[slave] = (*pending, asked)
        if lingers is not None:
            self._lingers[asked] = lingers

    def _drop(self, slave: int, over: Iterable[Pending], now: float) -> None:
        """Count these requests to `slave` as answered; those that linger are kept until then."""
        gone = []
        for each in over:
            if self._lingers.get(each, now) > now:
                self._over.add(each)
            else:
                self._forget(each)
                gone.append(each)
        kept = tuple(each for each in self.by_slave[slave] if each not in gone)
        if kept:
            self.by_slave[slave] = kept
        else:
            del self.by_slave[slave]
            self._quiet_until.pop(slave, None)

    def _forget(self, each: Pending) -> None:
        self._lingers.pop(each, None)
        self._over.discard(each)


def _over_by(outcome: Outcome, codec: Codec, pending: tuple[Pending, ...]) -> int:
    """Return how many of `pending`, the oldest first, are over by an answer to the request asked after them."""
    if outcome.answer is None and outcome.fault is not None and outcome.fault.code is not FaultCode.EXCEPTION:
        return 1
    if outcome.answer is None:
        return len(pending)
    alike = (place for place, each in enumerate(pending, 1) if _alike(outcome.request, codec, each))
    return next(alike, len(pending))


def _alike(request: Request, codec: Codec, other: Pending) -> bool:
    """Whether the answers of the two have one shape."""
    return codec.shapes(request)[0] == other.codec.shapes(other.request)[0]
