"""Giving a sensor another slave id: looked before, one write, then only asking counts. Pure.

Rules
-----
1. Before anything is written: the new id is silent in three questions at the line's rate and at each other rate of
   the profile, not one byte is heard; the sensor answers at its old id, it is there alone
   (see `recognition`: two of one id would both move), and nothing older can come from there; how the adapter
   echoes is known.
2. The intent is on the disk before the write. There is one write, to one slave, and no other register is written. Only
   where two had the old id and the one that stayed has stored the new one is its old id written back: it would come
   to the other's at its next power-up.
3. An echo, an exception, silence: all of them are only hints. For up to `VERIFY` both places are asked, once more
   right after that; what they say then is the truth.

================= ================== ======================= ==========================
new id            old id             its register            verdict
================= ================== ======================= ==========================
answers           silent                                     moved
answers           answers                                    duplicate_id
garbage           silent, garbage                            duplicate_id, stays open
garbage           answers                                    duplicate_id
silent            answers            exception to the write  refused
silent            answers            as before               dip_switch
silent            answers            the new id              power_cycle_needed, open
silent            silent, garbage                            not_verified, stays open
================= ================== ======================= ==========================
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from lfs10d.line.jobs.job import Hold
from lfs10d.line.jobs.procedure import Await, LineLostError, Step
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import WriteRegister
from lfs10d.reading import FaultCode
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.identity_query import PATIENT, SILENCE, IdentityQuery, IdentityReply
from lfs10d.reconfiguration.procedures.recognition import one_alone

VERIFY = 5.0
"""How long after the write both places are asked, in s."""
PAUSE = 0.25
"""Between two rounds of questions, in s."""
TRIES = 3
"""Questions before a place counts as silent."""
QUICK_LOOK = (None,) * TRIES
"""How long the last questions at the new id wait, in s (None: as usual), where looking is dear."""
PATIENT_LOOK = (None, None, PATIENT)
"""So right after a write: a slow sensor must not pass for silent."""
PROBE_TIMEOUTS = (0.2, 0.2, 0.6)
"""How long the three questions at a new id wait, in s."""
WRITE_TIMEOUT = 1.0
"""How long the write's echo is waited for, in s."""
ECHO_READS = 12
"""Reads after which the adapter's echo must be known."""


class ReaddressEnding(StrEnum):
    """What came of it. All before `MOVED` mean that nothing was written."""

    TAKEN = "taken"
    ABSENT = "absent"
    DEAF = "deaf"
    LOST_BEFORE = "lost_before"
    UNWRITTEN = "unwritten"
    TWINS = "twins"
    UNRECOGNISED = "unrecognised"
    FREE = "free"
    MOVED = "moved"
    BOTH = "both"
    GARBAGE = "garbage"
    REFUSED = "refused"
    LOCKED = "locked"
    PENDING = "pending"
    NOWHERE = "nowhere"


NOTHING_WRITTEN = frozenset(
    {
        ReaddressEnding.TAKEN,
        ReaddressEnding.ABSENT,
        ReaddressEnding.DEAF,
        ReaddressEnding.LOST_BEFORE,
        ReaddressEnding.UNWRITTEN,
        ReaddressEnding.TWINS,
        ReaddressEnding.UNRECOGNISED,
        ReaddressEnding.FREE,
    }
)
STAYS_OPEN = frozenset({ReaddressEnding.GARBAGE, ReaddressEnding.PENDING, ReaddressEnding.NOWHERE})
"""With these the sensor may yet appear at either place; so it may where its register says the new id."""


@dataclass(frozen=True, slots=True)
class ReaddressReport:
    """How it ended; `register` and `exception` are what the sensor said, `at` the rate where somebody was heard.

    `why` is what kept the intent from the disk, how two sensors show, or why it is not recognised. `stays_open`: the
    sensor may yet appear at either place.
    """

    ending: ReaddressEnding
    register: int | None = None
    exception: int | None = None
    at: int | None = None
    why: str = ""
    stays_open: bool = False


@dataclass(frozen=True, slots=True)
class IdWrite:
    """What is about to be written; answered with None when it is on the disk, else with why it is not."""

    old: Endpoint
    new: Endpoint
    register_before: int | None


@dataclass(frozen=True, slots=True)
class ReaddressWish:
    """What is wanted: the sensor at `old` at slave id `to`; `rates` are those of its profile."""

    old: Endpoint
    to: int
    rates: tuple[int, ...]
    dry_run: bool = False

    @property
    def new(self) -> Endpoint:
        """Where it is to answer."""
        return Endpoint(slave=self.to, baudrate=self.old.baudrate)


def readdress(
    wish: ReaddressWish, asking: IdentityQuery, echo_known: Callable[[], bool]
) -> Generator[Step, Any, ReaddressReport]:
    """Carry it out; see the rules."""
    try:
        refusal, before = yield from looked_before(wish, asking, echo_known)
        if refusal is not None:
            return refusal
        if wish.dry_run:
            return ReaddressReport(ReaddressEnding.FREE, before.register)
        why = yield Await(IdWrite(wish.old, wish.new, before.register))
        if why is not None:
            return ReaddressReport(ReaddressEnding.UNWRITTEN, why=str(why))
    except LineLostError:
        return ReaddressReport(ReaddressEnding.LOST_BEFORE)
    try:
        exception = yield from written(wish.old, asking.id_register, wish.to, asking)
        found = yield from verified(wish.old, wish.new, asking)
        verdict = judge(found, before.register, exception, wish.to)
        return (yield from parted(verdict, wish.old, wish.to, asking))
    except LineLostError:
        return ReaddressReport(ReaddressEnding.NOWHERE, stays_open=True)


def looked_before(
    wish: ReaddressWish, asking: IdentityQuery, echo_known: Callable[[], bool]
) -> Generator[Step, Any, tuple[ReaddressReport | None, IdentityReply]]:
    """Find out whether it may be written at all (rule 1); return why not, and what the sensor said."""
    before = yield from present(wish.old, asking)
    if before.register is None:
        return absent(before), before
    refusal = yield from alone(wish.old, wish.to, asking)
    if refusal is not None:
        return refusal, before
    for rate in sorted(set(wish.rates) - {wish.old.baudrate}):
        if not (yield from free(Endpoint(slave=wish.to, baudrate=rate), asking)):
            return ReaddressReport(ReaddressEnding.TAKEN, at=rate), before
    for _ in range(ECHO_READS):
        if echo_known():
            break
        yield from asking.who(wish.old)
    if not echo_known():
        return ReaddressReport(ReaddressEnding.DEAF), before
    # The long look at the new id over, it must answer now, and nothing from before may still be under way.
    again = yield from present(wish.old, asking)
    if not again.answers or not (yield from asking.settle(wish.old)):
        return ReaddressReport(ReaddressEnding.ABSENT), before
    return None, before


def absent(reply: IdentityReply) -> ReaddressReport:
    """Return what it means that no id was read at a place: nothing there, a refusal, or answers that collide."""
    if reply.noise and not reply.answers:
        return ReaddressReport(ReaddressEnding.TWINS, why="answers collide there")
    return ReaddressReport(ReaddressEnding.ABSENT, exception=reply.exception)


def alone(old: Endpoint, to: int, asking: IdentityQuery) -> Generator[Step, Any, ReaddressReport | None]:
    """Find out whether one sensor is at a place and nothing at the slave id `to`; return what is wrong, if anything."""
    look = yield from one_alone(old, Endpoint(slave=to, baudrate=old.baudrate), asking)
    if look.twins is not None:
        return ReaddressReport(ReaddressEnding.TWINS, why=look.twins)
    if not look.answers:
        return ReaddressReport(ReaddressEnding.ABSENT, exception=look.exception)
    return ReaddressReport(ReaddressEnding.TAKEN, at=old.baudrate) if look.taken else None


def present(spot: Endpoint, asking: IdentityQuery) -> Generator[Step, Any, IdentityReply]:
    """Ask a place up to three times, longer each time, until it answers."""
    reply = SILENCE
    for timeout in (None, 2 * asking.timeout, PATIENT):
        reply = yield from asking.who(spot, timeout)
        if reply.answers:
            break
    return reply


def free(spot: Endpoint, asking: IdentityQuery) -> Generator[Step, Any, bool]:
    """Whether not one byte is heard when a place is asked three times."""
    for timeout in PROBE_TIMEOUTS:
        reply = yield from asking.values(spot, timeout)
        if not reply.silent:
            return False
    return True


def written(spot: Endpoint, register: int, value: int, asking: IdentityQuery) -> Generator[Step, Any, int | None]:
    """Write once; return the code of an exception, if one came."""
    request = WriteRegister(spot.slave, register, value)
    baudrate = None if spot.baudrate == asking.line_rate else spot.baudrate
    outcome: Outcome = yield Ask(
        request, asking.codec, WRITE_TIMEOUT, None, baudrate, request_gap=asking.profile.request_gap
    )
    fault = outcome.fault
    if fault is not None and fault.code is FaultCode.EXCEPTION:
        return fault.exception_code
    return None


@dataclass(frozen=True, slots=True)
class ReaddressFinding:
    """What the two places said in the end; `spoilt`: again and again bytes at the new one that make no frame."""

    new: IdentityReply
    old: IdentityReply
    spoilt: bool = False


def verified(
    old: Endpoint, new: Endpoint, asking: IdentityQuery, look: Sequence[float | None] = PATIENT_LOOK
) -> Generator[Step, Any, ReaddressFinding]:
    """Ask both places until the new one answers and the old one is silent, for up to `VERIFY`, and once more."""
    until = asking.clock.now + VERIFY
    while asking.clock.now < until:
        reply = yield from asking.who(new)
        if reply.answers:
            return (yield from told(old, new, asking, look))
        yield from asking.who(old)
        yield Hold(asking.clock.now + PAUSE)
    return (yield from told(old, new, asking, look))


def told(
    old: Endpoint, new: Endpoint, asking: IdentityQuery, look: Sequence[float | None] = QUICK_LOOK
) -> Generator[Step, Any, ReaddressFinding]:
    """Ask each of two places until it answers or was silent `TRIES` times, at the new one as long as `look` says."""
    spoilt = 0
    at_new = SILENCE
    for timeout in look:
        reply = yield from asking.who(new, timeout)
        spoilt += reply.noise
        at_new = _nearer(at_new, reply)
        if reply.answers and not reply.noise:
            break
    if at_new.answers:
        # Two sensors that say the same id at the same time sound like one; their winds differ.
        for _ in range(TRIES):
            reply = yield from asking.values(new)
            spoilt += reply.noise
            if not reply.noise:
                break
    at_old = SILENCE
    for _ in range(TRIES):
        at_old = _nearer(at_old, (yield from asking.who(old)))
        if at_old.answers:
            break
    return ReaddressFinding(at_new, at_old, spoilt >= TRIES)


def parted(
    verdict: ReaddressReport, old: Endpoint, to: int, asking: IdentityQuery
) -> Generator[Step, Any, ReaddressReport]:
    """Have the one of two that stayed at `old` forget the new id, if it has stored that."""
    if verdict.ending is not ReaddressEnding.BOTH or verdict.register != to:
        return verdict
    for _ in range(TRIES):
        yield from written(old, asking.id_register, old.slave, asking)
        reply = yield from asking.who(old, PATIENT)
        if reply.register == old.slave:
            return replace(verdict, register=old.slave, stays_open=False)
    return verdict


def _nearer(one: IdentityReply, other: IdentityReply) -> IdentityReply:
    return max(one, other, key=lambda reply: (reply.answers, reply.noise))


def judge(found: ReaddressFinding, register_before: int | None, exception: int | None, to: int) -> ReaddressReport:
    """Return what follows from what the two places said, by the table."""
    new, old = found.new, found.old
    if old.answers and (new.answers or found.spoilt):
        ending = ReaddressEnding.BOTH
    elif found.spoilt:
        ending = ReaddressEnding.GARBAGE
    elif new.answers:
        return ReaddressReport(ReaddressEnding.MOVED, new.register, exception)
    elif not old.answers:
        ending = ReaddressEnding.NOWHERE
    elif exception is not None:
        ending = ReaddressEnding.REFUSED
    else:
        ending = ReaddressEnding.PENDING if old.register == to != register_before else ReaddressEnding.LOCKED
    return ReaddressReport(ending, old.register, exception, stays_open=ending in STAYS_OPEN or old.register == to)
