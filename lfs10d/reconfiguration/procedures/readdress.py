"""Gives a sensor another slave id: checked before, one write, and verified by reading. Pure.

Rules
-----
1. Before anything is written: the new id is silent in three reads at the line's rate and at each other rate of
   the profile, not one byte is received; the sensor answers at its old id, it is alone there
   (see `recognition`: two of one id would both move), no older request to it can still be answered; and it is known
   how the adapter echoes.
2. The intent is on the disk before the write. There is one write, to one slave, and no other register is written. Only
   where two had the old id and the one that stayed has stored the new one is its old id written back: it would come
   to the other's at its next power-up.
3. An echo, an exception, silence after the write: all of them are only hints. For up to `VERIFY` both places are
   read, and once more right after that; what they answer then counts. An exception of a gateway is no answer, and where
   the register cannot be read the sensor may have stored the new id, whatever ending.

================= ================== ======================= ==========================
new id            old id             its register            ending
================= ================== ======================= ==========================
answers           silent                                     moved
answers           answers                                    duplicate_id
garbage           silent, garbage                            duplicate_id, stays open
garbage           answers                                    duplicate_id
silent            answers            exception to the write  refused
silent            answers            as before               dip_switch
silent            answers            the new id              power_cycle_needed, open
silent            answers            refused                 not_verified, stays open
silent            silent, garbage                            not_verified, stays open
================= ================== ======================= ==========================
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import StrEnum
from itertools import takewhile

from lfs10d.line.jobs.job import Hold
from lfs10d.line.jobs.procedure import Await, LineLostError, Steps
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.request import WriteRegister
from lfs10d.reading import FaultCode
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.identity_query import PATIENT, SILENCE, IdentityQuery, IdentityReply
from lfs10d.reconfiguration.procedures.recognition import look_for_twins
from lfs10d.system.dataclass import dataclass

VERIFY = 5.0
"""Seconds after the write in which both places are read."""
PAUSE = 0.25
"""Pause between two rounds of reads, in s."""
TRIES = 3
"""Reads without an answer before a place counts as silent."""
QUICK_LOOK = (None,) * TRIES
"""Time-outs of the last reads at the new id, in s (None: the usual one), where a long look costs too much."""
PATIENT_LOOK = (None, None, PATIENT)
"""The same right after a write: a slow sensor must not count as silent."""
PROBE_TIMEOUTS = (0.2, 0.2, 0.6)
"""Time-outs of the three reads at a new id, in s."""
WRITE_TIMEOUT = 1.0
"""Time-out of the write's reply, in s."""
ECHO_READS = 12
"""Reads after which it must be known how the adapter echoes."""


class ReaddressEnding(StrEnum):
    """The outcome of a re-address. All before `MOVED` mean that nothing was written."""

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


NOTHING_WRITTEN = frozenset(takewhile(lambda ending: ending is not ReaddressEnding.MOVED, ReaddressEnding))
STAYS_OPEN = frozenset({ReaddressEnding.GARBAGE, ReaddressEnding.PENDING, ReaddressEnding.NOWHERE})
"""Endings after which the sensor may still appear at either place; also if its register has the new id."""


@dataclass(frozen=True, slots=True)
class ReaddressReport:
    """How it ended; `register` and `exception` are what the sensor answered, `at` the rate where bytes came.

    `why` is what kept the intent from the disk, the sign of two sensors, or why it is not recognised. `stays_open`: the
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
    """The intent to write; answered with None once it is on the disk, else with the reason."""

    old: Endpoint
    new: Endpoint
    register_before: int | None


@dataclass(frozen=True, slots=True)
class ReaddressWish:
    """The re-address to make: from `old` to slave id `to`; `rates` are those of its profile."""

    old: Endpoint
    to: int
    rates: tuple[int, ...]
    dry_run: bool = False

    @property
    def new(self) -> Endpoint:
        """The new place of the sensor."""
        return Endpoint(slave=self.to, baudrate=self.old.baudrate)


def readdress(wish: ReaddressWish, query: IdentityQuery, echo_known: Callable[[], bool]) -> Steps[ReaddressReport]:
    """Give a sensor another slave id by the rules above."""
    try:
        refusal, before = yield from check_before_write(wish, query, echo_known)
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
        exception = yield from write(wish.old, query.id_register, wish.to, query)
        found = yield from verify(wish.old, wish.new, query)
        report = judge(found, before.register, exception, wish.to)
        return (yield from undo_stored_id(report, wish.old, wish.to, query))
    except LineLostError:
        return ReaddressReport(ReaddressEnding.NOWHERE, stays_open=True)


def check_before_write(
    wish: ReaddressWish, query: IdentityQuery, echo_known: Callable[[], bool]
) -> Steps[tuple[ReaddressReport | None, IdentityReply]]:
    """Check whether it may be written at all (rule 1); return why not, and what the sensor answered."""
    before = yield from query.read_patiently(wish.old)
    if before.register is None:
        return absent(before), before
    refusal = yield from alone(wish.old, wish.to, query)
    if refusal is not None:
        return refusal, before
    for rate in sorted(set(wish.rates) - {wish.old.baudrate}):
        if not (yield from free(Endpoint(slave=wish.to, baudrate=rate), query)):
            return ReaddressReport(ReaddressEnding.TAKEN, at=rate), before
    ending = yield from not_ready(wish.old, query, echo_known)
    return None if ending is None else ReaddressReport(ending), before


def not_ready(old: Endpoint, query: IdentityQuery, echo_known: Callable[[], bool]) -> Steps[ReaddressEnding | None]:
    """Return why a sensor cannot be written to now: the echo is not known, no answer, or an old request under way."""
    for _ in range(ECHO_READS):
        if echo_known():
            break
        yield from query.read_register(old)
    if not echo_known():
        return ReaddressEnding.DEAF
    again = yield from query.read_patiently(old)
    return None if again.answers and (yield from query.settle(old)) else ReaddressEnding.ABSENT


def absent(reply: IdentityReply) -> ReaddressReport:
    """Return why no id was read at a place: nothing there, a refusal, or answers that collide."""
    if reply.noise and not reply.answers:
        return ReaddressReport(ReaddressEnding.TWINS, why="answers collide there")
    return ReaddressReport(ReaddressEnding.ABSENT, exception=reply.exception)


def alone(old: Endpoint, to: int, query: IdentityQuery) -> Steps[ReaddressReport | None]:
    """Check that one sensor is at a place and none at the slave id `to`; return the problem, if any."""
    look = yield from look_for_twins(old, Endpoint(slave=to, baudrate=old.baudrate), query)
    if look.twins is not None:
        return ReaddressReport(ReaddressEnding.TWINS, why=look.twins)
    if not look.answers:
        return ReaddressReport(ReaddressEnding.ABSENT, exception=look.exception)
    return ReaddressReport(ReaddressEnding.TAKEN, at=old.baudrate) if look.taken else None


def free(endpoint: Endpoint, query: IdentityQuery) -> Steps[bool]:
    """Return whether no byte is received in three reads at a place."""
    for timeout in PROBE_TIMEOUTS:
        reply = yield from query.read_values(endpoint, timeout)
        if not reply.silent:
            return False
    return True


def write(endpoint: Endpoint, register: int, value: int, query: IdentityQuery) -> Steps[int | None]:
    """Write once; return the code of an exception, if one came."""
    request = WriteRegister(endpoint.slave, register, value, query.profile.write_function)
    asked = Ask(request, query.codec, WRITE_TIMEOUT, None, endpoint.baudrate, request_gap=query.profile.request_gap)
    fault = (yield from query.put(asked)).fault
    if fault is not None and fault.code is FaultCode.EXCEPTION:
        return fault.exception_code
    return None


@dataclass(frozen=True, slots=True)
class ReaddressFinding:
    """The last replies of the two places; `spoilt`: repeatedly bytes without a frame at the new one."""

    new: IdentityReply
    old: IdentityReply
    spoilt: bool = False


def verify(
    old: Endpoint, new: Endpoint, query: IdentityQuery, look: Sequence[float | None] = PATIENT_LOOK
) -> Steps[ReaddressFinding]:
    """Read both places until the new one answers and the old one is silent, for up to `VERIFY`, and once more."""
    until = query.clock.now + VERIFY
    while query.clock.now < until:
        reply = yield from query.read_register(new)
        if reply.answers:
            break
        yield from query.read_register(old)
        yield Hold(query.clock.now + PAUSE)
    return (yield from read_both(old, new, query, look))


def read_both(
    old: Endpoint, new: Endpoint, query: IdentityQuery, look: Sequence[float | None] = QUICK_LOOK
) -> Steps[ReaddressFinding]:
    """Read each of two places until it answers or was silent `TRIES` times; `look` has the time-outs at the new one."""
    spoilt = 0
    at_new = SILENCE
    for timeout in look:
        reply = yield from query.read_register(new, timeout)
        spoilt += reply.noise
        at_new = _nearer(at_new, reply)
        if reply.answers and not reply.noise:
            break
    if at_new.answers:
        # Two sensors that answer the same id at the same time look like one; their values differ.
        for _ in range(TRIES):
            reply = yield from query.read_values(new)
            spoilt += reply.noise
            if not reply.noise:
                break
    at_old = SILENCE
    for _ in range(TRIES):
        at_old = _nearer(at_old, (yield from query.read_register(old)))
        if at_old.register is not None:
            break
    return ReaddressFinding(at_new, at_old, spoilt >= TRIES)


def undo_stored_id(report: ReaddressReport, old: Endpoint, to: int, query: IdentityQuery) -> Steps[ReaddressReport]:
    """Let the one of two sensors that stayed at `old` forget the new id, if it stored that."""
    if report.ending is not ReaddressEnding.BOTH or report.register != to:
        return report
    for _ in range(TRIES):
        yield from write(old, query.id_register, old.slave, query)
        reply = yield from query.read_register(old, PATIENT)
        if reply.register == old.slave:
            return replace(report, register=old.slave, stays_open=False)
    return report


def _nearer(one: IdentityReply, other: IdentityReply) -> IdentityReply:
    return max(one, other, key=lambda reply: (reply.register is not None, reply.answers, reply.noise, not reply.silent))


def judge(found: ReaddressFinding, register_before: int | None, exception: int | None, to: int) -> ReaddressReport:
    """Return the ending that follows from the replies of the two places, by the table."""
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
    elif old.register is None:
        ending = ReaddressEnding.NOWHERE
    else:
        ending = ReaddressEnding.PENDING if old.register == to != register_before else ReaddressEnding.LOCKED
    may_obey = old.answers and old.register in (None, to)  # at its next power-up
    return ReaddressReport(ending, old.register, exception, stays_open=ending in STAYS_OPEN or may_obey)
