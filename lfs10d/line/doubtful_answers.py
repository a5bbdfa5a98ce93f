"""Doubts an answer that may be the second answer to the request before. Pure. Durations in s.

A second answer may come as soon as the next request is out, and looks like the answer to that.

Rules
-----
1. An answer is *clean* if nothing that looks like it had come from its slave, or whoever spoke for it, for `WATCHED`
   when it was asked; where it is known to be answered twice, for as long as that takes. Only what is not clean may be a
   second answer.
2. After an exchange in which bytes came that are no right frame the slave is left alone for `WATCHED`: what was asked
   then may be answered twice as well.
3. An answer that is not clean is *doubtful* if hardly any of the last answers took as long, if another frame of the
   slave or other bytes came with it; a clean one only if what came with it may be an answer that was broken, and that
   not `VAIN` times in a row. It counts as not given: the slave is left alone for `WATCHED` (its time-out where that is
   longer), and asked again. A doubtful answer teaches no usual time.
4. Where leaving it alone showed nothing `VAIN` times in a row, its noise is trusted for `TRUST`, doubled each time up
   to `TRUST_MOST`: some lines make noise before each answer, some lose 2 of 100. Broken answers are trusted only
   `APART` from each other, and none for `TRUST_MOST` after a second answer.
5. Any other answer that is not clean has to be proved (`lfs10d.line.unproved_answers`). It is so too when nothing of
   the slave came for `WATCHED`, though it was not asked. A second frame of the slave before that shows that nobody
   knows which of the two it was.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from dataclasses import field
from math import inf

from lfs10d.line.device import CONFIDENT_FROM, LEARNED_FROM, ResponseTimes
from lfs10d.line.quiet_watch import spoilt
from lfs10d.line.unproved_answers import UnprovedAnswers
from lfs10d.modbus.duplicates import WATCHED, Duplicates
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import ReadRegisters, Request
from lfs10d.reading import FaultCode
from lfs10d.system.dataclass import dataclass

LEAST_MARGIN = 0.002
"""Response times count as equal within this (s), or within half the answer's length if that is more."""
APART = 0.15
"""Broken answers closer together than this (s) are never trusted."""
ALIKE = 2
"""Recent answers with an equal response time that make one trustworthy; one of the first `CONFIDENT_FROM`."""
VAIN = 3
"""Number of unfounded doubts in a row after which noise raises none."""
TRUST = 10.0
"""Seconds for which noise raises no doubt after an unfounded one; doubled after each."""
TRUST_MOST = 600.0
"""Longest such time in s."""
OWN_MOST = 0.25
"""Longest wait in s for the slave's own answer after the one that came."""
TARDY = 1.0
"""The same for a slave that is answered twice and has sent a late answer."""
YOUNG = 1.25
"""While few answers are known, the slowest is multiplied by this."""
EXCEPTION_LOOK = -1
"""In place of its number of data bytes."""
FRAME_LEAST = 5
"""Characters of an answer that are no data: slave id, function, count, check."""


@dataclass(slots=True)
class _SlaveTrust:
    spoke: float = -inf
    """Time of the last bytes from it, or in an exchange with it, other than plain answers."""
    answered: dict[object, float] = field(default_factory=dict)
    """When each look of a plain answer came last: a second one looks the same."""
    second_at: float = -inf
    """Time of its last valid frame that was no answer."""
    broken_at: float = -inf
    took: deque[float] = field(default_factory=lambda: deque(maxlen=LEARNED_FROM))
    """Response times of its last trusted answers."""
    unproved: UnprovedAnswers = field(default_factory=UnprovedAnswers)
    held_until: float = -inf
    """Until when a second frame of the slave shows that an unproved answer may not have been its own."""
    proved: bool = True
    """Nothing was unproved any more when its last exchange was over, that one left out."""
    doubted: bool = False
    """Noise raised a doubt that is not settled yet."""
    in_a_row: int = 0
    """Number of doubtful answers in a row."""
    vain: int = 0
    """Number of unfounded doubts in a row."""
    trust: float = TRUST
    trusted_until: float = -inf


class DoubtfulAnswers:
    """The doubts about the slaves of one line."""

    def __init__(self, duplicates: Duplicates) -> None:
        self._duplicates = duplicates
        self._slaves: dict[int, _SlaveTrust] = {}

    def _state(self, slave: int) -> _SlaveTrust:
        state = self._slaves.get(slave)
        if state is None:
            state = self._slaves[slave] = _SlaveTrust()
        return state

    def spoke(self, slave: int, at: float, *, second: bool = False) -> None:
        """Note a frame to or from a slave which is no answer to us; `second`: one too many."""
        state = self._state(slave)
        if second:
            state.second_at = at
        if not (second and self._duplicates.known(slave)):
            state.spoke = max(state.spoke, at)

    def exchanged(
        self, outcome: Outcome, usual: ResponseTimes, timeout: float, *, tardy: bool = False, explained: bool = False
    ) -> bool:
        """Take an exchange that is over; whether its answer must not be believed. `usual` are the answers before.

        `tardy`: some answer of the slave has come after its time. `explained`: noise is another master's doing.
        """
        slave, began = outcome.request.slave, outcome.began
        if outcome.late:
            self._late(outcome)
        if began is None:
            return False
        state, wanted = self._state(slave), _wanted(outcome.request)
        unproved = state.unproved
        spoke = max(state.spoke, state.answered.get(wanted, -inf))
        clean = unproved.own_by <= began and began - spoke >= self._duplicates.watched(slave)
        if not outcome.heard:
            state.proved = not unproved.answers
            state.held_until = max(state.held_until, outcome.ended + WATCHED)
            return False
        if state.doubted:
            self._settle(slave, state, outcome.ended)
        if clean and unproved.answers:
            unproved.forget()
        beside = _beside(outcome) if outcome.strays else b""
        look = _look(outcome, wanted)
        _note_look(state, outcome, look, beside)
        state.proved = not unproved.answers
        state.held_until = max(outcome.ended + WATCHED, unproved.own_by)
        if outcome.answer is None:
            self._without_answer(slave, state, outcome, explained=explained)
            return False
        if self._doubted(state, outcome, beside, None if clean else usual, explained=explained):
            rest = outcome.ended + max(WATCHED, timeout)
            self._duplicates.rest(slave, rest)
            state.held_until = max(state.held_until, rest)
            return True
        if not clean:
            may_be_late = tardy and self._duplicates.extras(slave) > 0
            self._prove(state, outcome, look, outcome.ended + TARDY if may_be_late else _own_by(outcome, state.took))
        state.took.append(outcome.turnaround or 0.0)
        return False

    def _late(self, outcome: Outcome) -> None:
        for late in outcome.late:
            if late.request.slave != outcome.request.slave:
                self.spoke(late.request.slave, outcome.ended)

    def _doubted(
        self, state: _SlaveTrust, outcome: Outcome, beside: bytes, usual: ResponseTimes | None, *, explained: bool
    ) -> bool:
        """Whether an answer is doubtful (rule 3); a clean one has no `usual`."""
        doubted = noise = False
        if beside:
            noise = bool(state.unproved.answers) or not self._trusted(state, outcome.ended)
            doubted = state.in_a_row < VAIN and _broken_answer(outcome, beside, explained=explained)
        if usual is not None and not doubted:
            second = outcome.began is not None and state.second_at >= outcome.began
            doubted = (noise and not explained) or second or _unusual(outcome, usual)
        state.doubted = doubted and bool(beside)
        state.in_a_row = state.in_a_row + 1 if doubted else 0
        return doubted

    def _prove(self, state: _SlaveTrust, outcome: Outcome, look: object, own_by: float) -> None:
        """Count an answer as unproved where the slave's own may still come."""
        if state.unproved.answers:  # if one of those is a second one, this may be the own of the one before
            own_by = max(own_by, state.unproved.own_by + _length(outcome))
        if own_by > outcome.ended:
            state.unproved.add(look, outcome.ended, own_by)
            state.held_until = max(state.held_until, own_by)

    def proved(self, slave: int) -> bool:
        """Whether no answer of the slave was unproved when its last exchange was over, that one's left out."""
        return self._state(slave).proved

    def unproved(self, slave: int) -> bool:
        """Whether the answer of the slave's last exchange, or one before, is unproved."""
        state = self._slaves.get(slave)
        return state is not None and bool(state.unproved.answers)

    def overdue(self, slave: int, now: float) -> bool:
        """Whether answers of the slave have been unproved for too long."""
        return self._state(slave).unproved.overdue(now)

    def held_until(self, slave: int) -> float:
        """Return until when what is unproved is held back, if the slave is not asked again before."""
        return self._state(slave).held_until

    def own_by(self, slave: int) -> float:
        """Return until when an own answer of the slave may still come in place of an unproved one."""
        return self._state(slave).unproved.own_by

    def decided(self, slave: int) -> None:
        """Note that the slave's unproved answers were given up."""
        self._state(slave).unproved.forget()

    def doubt(self, slave: int, now: float, *, silent: bool, own: bool) -> bool:
        """Doubt the unproved answers of a slave, for broken bytes came behind them, or it was `silent`.

        False where noise is trusted, which it is in the exchange of another slave only; `own`: it was this one's.
        """
        state = self._state(slave)
        if not silent:
            if not own and self._trusted(state, now):
                return False
            state.doubted = True
            self._duplicates.rest(slave, now + WATCHED)
        state.unproved.forget()
        return True

    def _without_answer(self, slave: int, state: _SlaveTrust, outcome: Outcome, *, explained: bool) -> None:
        """Leave the slave alone where bytes came that are no right frame, if its noise is not trusted (rule 2)."""
        if explained or not spoilt(outcome):
            return
        near = outcome.asked - state.broken_at < APART
        state.broken_at = outcome.ended
        if near or not self._trusted(state, outcome.ended):
            state.doubted = True
            self._duplicates.rest(slave, outcome.ended + WATCHED)

    def _trusted(self, state: _SlaveTrust, now: float) -> bool:
        return now < state.trusted_until and now - state.second_at > TRUST_MOST

    def _settle(self, slave: int, state: _SlaveTrust, now: float) -> None:
        """Trust the slave's noise if the doubt was in vain."""
        state.doubted = False
        if self._duplicates.extras(slave):
            state.vain = 0
            return
        state.vain += 1
        if state.vain >= VAIN:
            state.trusted_until = now + state.trust
            state.trust = min(2 * state.trust, TRUST_MOST)


def _note_look(state: _SlaveTrust, outcome: Outcome, look: object, beside: bytes) -> None:
    """Note when an answer of this look came, and what it proves; what is no plain answer is any sign of the slave."""
    if look is None or outcome.late or (beside and _broken_answer(outcome, beside, explained=False)):
        state.spoke = outcome.ended
    else:
        state.answered[look] = outcome.ended
    if state.unproved.answers and look is not None and not beside:
        state.unproved.answered(outcome.began or 0.0, look)


def _look(outcome: Outcome, wanted: object) -> object:
    """Return what tells the answer from those to other requests, `wanted` where it is a right one; None without one."""
    if outcome.fault is not None and outcome.fault.code is FaultCode.EXCEPTION and not outcome.may_follow:
        return outcome.request.function, EXCEPTION_LOOK
    return None if outcome.answer is None else wanted


def _wanted(request: Request) -> object:
    """Return what tells the answer to a request from those to others."""
    return request.function, request.data_bytes if isinstance(request, ReadRegisters) else request


def _beside(outcome: Outcome) -> bytes:
    """Return what came with an answer and belongs to nothing, our own request left out: the adapter may return it."""
    return b"".join(data for data, _ in outcome.strays).replace(outcome.sent, b"")


def _broken_answer(outcome: Outcome, beside: bytes, *, explained: bool) -> bool:
    """Whether what came with the answer may be another one, broken: it begins as one, or is as long, unexplained."""
    request = outcome.request
    size = FRAME_LEAST + (request.data_bytes if isinstance(request, ReadRegisters) else 0)
    return bytes((request.slave, request.function)) in beside or (len(beside) >= size and not explained)


def _length(outcome: Outcome) -> float:
    """Return how long an answer that came took from its first to its last byte, as it was read."""
    return outcome.ended - (outcome.sent_end or 0.0) - (outcome.turnaround or 0.0)


def _unusual(outcome: Outcome, usual: ResponseTimes) -> bool:
    if not usual or outcome.turnaround is None:
        return False
    margin = max(LEAST_MARGIN, _length(outcome) / 2)
    alike = ALIKE if len(usual) >= CONFIDENT_FROM else 1
    return usual.count_near(outcome.turnaround, margin) < alike


def _own_by(outcome: Outcome, took: Collection[float]) -> float:
    """Return when an answer to the same request would begin that takes longer than the slowest by half their spread."""
    slowest, fastest = max(took, default=0.0), min(took, default=0.0)
    late = slowest if len(took) >= CONFIDENT_FROM else YOUNG * slowest
    own_by = (outcome.sent_end or 0.0) + late + max(LEAST_MARGIN, (slowest - fastest) / 2)
    return min(own_by, outcome.ended + OWN_MOST)
