"""Adopts a factory-new sensor: found at its factory id, brought to the line's rate, given a free id. Pure.

Rules
-----
1. It is looked for at the line's rate first, then at its factory's and at each other rate of its profile. Where
   something answers at several, or garbage is received, there is more than one: plug in one at a time.
2. What answers must be recognised as a sensor of the profile, and must be there alone (see `recognition`):
   nothing is ever written to another device.
3. A new id is free if not one byte is received from it, at any rate. The candidates are tried in order.
4. One intent, on the disk before the first write, covers all. First the rate is written, while the sensor still has
   its factory id: cut short there, it is found again by the same request. Then it is given its id, verified as in
   `lfs10d.reconfiguration.procedures.readdress`.
"""

from __future__ import annotations

from collections.abc import Callable

from lfs10d.line.jobs.procedure import Await, LineLostError, Steps
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.baudrate import RateSensor, restore_rate, write_rate
from lfs10d.reconfiguration.procedures.identity_query import IdentityQuery
from lfs10d.reconfiguration.procedures.readdress import (
    IdWrite,
    ReaddressEnding,
    ReaddressReport,
    alone,
    free,
    judge,
    not_ready,
    undo_stored_id,
    verify,
    write,
)
from lfs10d.reconfiguration.procedures.recognition import recognise
from lfs10d.system.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class AdoptWish:
    """The adoption to make: the sensor at slave id `factory` gets one of `candidates` and the `line_rate`.

    `rates` are those of its profile, in the order in which it is looked for.
    """

    factory: int
    candidates: tuple[int, ...]
    line_rate: int
    rates: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class AdoptReport:
    """How it ended: the sensor was at `old`, and was to get `to` (None: no id is free)."""

    readdress: ReaddressReport
    old: Endpoint | None = None
    to: int | None = None
    at_rate: bool = True
    """False: it ended when the rate was written; the id is unchanged."""
    rate_code: int | None = None
    """The content of its rate register when it was recognised."""


def adopt(wish: AdoptWish, query: IdentityQuery, echo_known: Callable[[], bool]) -> Steps[AdoptReport]:
    """Adopt one factory-new sensor by the rules above."""
    try:
        looked = yield from _check_before_write(wish, query, echo_known)
        if looked.readdress.ending is not ReaddressEnding.FREE or looked.old is None or looked.to is None:
            return looked
        old, to = looked.old, looked.to
        new = Endpoint(slave=to, baudrate=wish.line_rate)
        why = yield Await(IdWrite(old, new, looked.readdress.register))
        if why is not None:
            return AdoptReport(ReaddressReport(ReaddressEnding.UNWRITTEN, why=str(why)), old, to)
    except LineLostError:
        return AdoptReport(ReaddressReport(ReaddressEnding.LOST_BEFORE))
    try:
        if old.baudrate != wish.line_rate:
            report = yield from _at_line_rate(old, wish.line_rate, query.knowing(old.baudrate, looked.rate_code))
            if report is not None:
                return AdoptReport(report, old, to, at_rate=False)
        here = Endpoint(slave=old.slave, baudrate=wish.line_rate)
        exception = yield from write(here, query.id_register, to, query)
        found = yield from verify(here, new, query)
        report = judge(found, looked.readdress.register, exception, to)
        return AdoptReport((yield from undo_stored_id(report, here, to, query)), old, to)
    except LineLostError:
        return AdoptReport(ReaddressReport(ReaddressEnding.NOWHERE, stays_open=True), old, to)


def _check_before_write(wish: AdoptWish, query: IdentityQuery, echo_known: Callable[[], bool]) -> Steps[AdoptReport]:
    """Find the new sensor and a free id; return `FREE` if it may be written."""
    newcomer = yield from _newcomer(wish, query)
    old = newcomer.old
    if newcomer.readdress.ending is not ReaddressEnding.FREE or old is None:
        return newcomer
    to, refusal = yield from _free_id(wish, old, query)
    if to is None:
        return AdoptReport(
            ReaddressReport(ReaddressEnding.TAKEN, at=old.baudrate), old, next(iter(wish.candidates), None)
        )
    if refusal is not None:
        return AdoptReport(refusal, old, to)
    ending = yield from not_ready(old, query, echo_known)
    if ending is not None:
        return AdoptReport(ReaddressReport(ending), old, to)
    return AdoptReport(newcomer.readdress, old, to, rate_code=newcomer.rate_code)


def _newcomer(wish: AdoptWish, query: IdentityQuery) -> Steps[AdoptReport]:
    """Find the one sensor at the factory id; `FREE` if there is just one, and it is recognised."""
    found: list[AdoptReport] = []
    for rate in wish.rates:
        endpoint = Endpoint(slave=wish.factory, baudrate=rate)
        reply = yield from query.read_patiently(endpoint)
        if reply.silent:
            continue
        ending, why, code = ReaddressEnding.BOTH, "", None
        if reply.answers or reply.exception is not None:
            recognition = yield from recognise(endpoint, reply, query)
            why, code = recognition.why or "", recognition.rate_code
            if not recognition.spoilt:  # the values of two differ, though both answer the same id
                ending = ReaddressEnding.UNRECOGNISED if why else ReaddressEnding.FREE
        report = ReaddressReport(ending, reply.register, reply.exception, rate, why)
        found.append(AdoptReport(report, endpoint, rate_code=code))
    if not found:
        return AdoptReport(ReaddressReport(ReaddressEnding.ABSENT))
    if len(found) > 1:
        return AdoptReport(ReaddressReport(ReaddressEnding.BOTH, at=found[0].readdress.at), found[0].old)
    return found[0]


def _free_id(wish: AdoptWish, old: Endpoint, query: IdentityQuery) -> Steps[tuple[int | None, ReaddressReport | None]]:
    """Return the first silent candidate (None if there is none), and why it must not be written.

    At the new sensor's own rate the candidate is read while it is checked that the new sensor is alone.
    """
    for candidate in wish.candidates:
        clear = True
        for rate in wish.rates:
            if rate != old.baudrate:
                clear = clear and (yield from free(Endpoint(slave=candidate, baudrate=rate), query))
        refusal = (yield from alone(old, candidate, query)) if clear else ReaddressReport(ReaddressEnding.TAKEN)
        if refusal is None or refusal.ending is not ReaddressEnding.TAKEN:
            return candidate, refusal
    return None, None


def _at_line_rate(old: Endpoint, rate: int, query: IdentityQuery) -> Steps[ReaddressReport | None]:
    """Bring the new sensor to the line's rate; return why that failed, None if it did not."""
    sensor = RateSensor("", old.slave, query)
    exception, at, twins = yield from write_rate(sensor, old.baudrate, rate)
    if twins:
        back = yield from restore_rate(sensor, old.baudrate, rate)
        return ReaddressReport(ReaddressEnding.BOTH, at=old.baudrate, stays_open=back is None)
    if at == rate:
        return None
    if at is None:
        return ReaddressReport(ReaddressEnding.NOWHERE, exception=exception, stays_open=True)
    if exception is not None:
        back = yield from restore_rate(sensor, old.baudrate, rate)
        return ReaddressReport(ReaddressEnding.REFUSED, exception=exception, stays_open=back is None)
    # What it stored may stay: after a power cycle the same request finds it at the line's rate.
    return ReaddressReport(ReaddressEnding.PENDING)
