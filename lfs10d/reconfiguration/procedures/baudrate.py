"""Moves every sensor of a line to another rate, one after the other, or back. Pure.

Rules
-----
1. Before anything is written every sensor answers, disabled ones too, and the adapter's echo is known. The intent
   is on the disk before the first write. Only the register of the rate is written, and only to one slave at a time.
2. The first sensor is the canary: if it answers only at the old rate its register is written back, and nothing else
   is touched. Each next one is written when the one before answers at the new rate.
3. If a later one fails, those already moved are moved back, for up to `ROLL_BACK`; so are those that have stored the
   new rate since an earlier change and wait for their power cycle. One that answers at both rates since the write is
   two sensors: they are moved back too. The other of two may be deaf just then: all are looked for once more. Or it has
   stored the rate and answers later: each that was moved back is written once more, where both hear it.
4. With `power_cycle` all are written and none is expected at the new rate yet; each register must say the new rate.
5. A sensor that is lost is looked for until it is found, and brought to the line's rate (see `recover_baudrate`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from enum import StrEnum
from itertools import takewhile
from typing import TypeAlias

from lfs10d.line.jobs.job import Hold
from lfs10d.line.jobs.procedure import Await, LineLostError, Steps
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.identity_query import PATIENT, IdentityQuery
from lfs10d.reconfiguration.procedures.readdress import ECHO_READS, TRIES, VERIFY, verify, write
from lfs10d.system.dataclass import dataclass

ROLL_BACK = 60.0
"""Longest time in s for moving sensors back."""
FIRST_PAUSE = 1.0
"""Pause between two rounds of reads of missing sensors, in s; doubled after each."""


Where: TypeAlias = dict[str, int | None]
"""The rate at which each sensor was found last, None for one that was not."""


class BaudrateEnding(StrEnum):
    """The outcome of a change of rate. All before `MOVED` mean that nothing was written."""

    ABSENT = "absent"
    DEAF = "deaf"
    LOST_BEFORE = "lost_before"
    UNWRITTEN = "unwritten"
    FREE = "free"
    MOVED = "moved"
    PENDING = "pending"
    REFUSED = "refused"
    CANARY = "canary"
    TWINS = "twins"
    ROLLED_BACK = "rolled_back"
    UNVERIFIED = "unverified"


UNTOUCHED = frozenset(takewhile(lambda ending: ending is not BaudrateEnding.MOVED, BaudrateEnding))


@dataclass(frozen=True, slots=True)
class RateSensor:
    """One sensor: its name, its slave id, and its query."""

    name: str
    slave: int
    query: IdentityQuery

    def at(self, baudrate: int) -> Endpoint:
        """Return the place at a rate."""
        return Endpoint(slave=self.slave, baudrate=baudrate)

    def code(self, baudrate: int) -> int:
        """Return the content of its register for a rate."""
        register = self.query.profile.baudrate
        return -1 if register is None else register.codes[baudrate]

    @property
    def register(self) -> int:
        """The address of the register of its rate."""
        register = self.query.profile.baudrate
        return -1 if register is None else register.register


@dataclass(frozen=True, slots=True)
class RateWish:
    """The change of rate to make."""

    sensors: tuple[RateSensor, ...]
    old: int
    to: int
    power_cycle: bool = False
    dry_run: bool = False
    stored: frozenset[str] = frozenset()
    """Sensors that stored the new rate in an earlier change, and would use it after their next power-up."""

    def touched(self, last: int) -> tuple[RateSensor, ...]:
        """Return the sensors that have, or may have, stored the new rate when the `last` one was written."""
        return tuple(each for n, each in enumerate(self.sensors) if n <= last or each.name in self.stored)


@dataclass(frozen=True, slots=True)
class BaudrateReport:
    """How it ended: `where` is the rate at which each sensor was found last, None for one that was not.

    `names` are the sensors it is about, `why` what kept the intent from the disk.
    """

    ended: BaudrateEnding
    where: Mapping[str, int | None] = field(default_factory=dict)
    names: tuple[str, ...] = ()
    exception: int | None = None
    why: str = ""


@dataclass(frozen=True, slots=True)
class WriteRates:
    """The intent to write to the sensors; answered with None once it is on the disk, else with the reason."""


def change_rate(wish: RateWish, echo_known: Callable[[], bool]) -> Steps[BaudrateReport]:
    """Move every sensor to another rate by the rules above."""
    try:
        refusal = yield from _check_before_write(wish, echo_known)
        if refusal is not None:
            return refusal
        why = yield Await(WriteRates())
        if why is not None:
            return BaudrateReport(BaudrateEnding.UNWRITTEN, why=str(why))
    except LineLostError:
        return BaudrateReport(BaudrateEnding.LOST_BEFORE)
    where: Where = {sensor.name: wish.old for sensor in wish.sensors}
    try:
        if wish.power_cycle:
            return (yield from _all_written(wish, where))
        return (yield from _one_by_one(wish, where))
    except LineLostError:
        return BaudrateReport(BaudrateEnding.UNVERIFIED, dict.fromkeys(where))


def _check_before_write(wish: RateWish, echo_known: Callable[[], bool]) -> Steps[BaudrateReport | None]:
    absent = []
    for sensor in wish.sensors:
        reply = yield from sensor.query.read_patiently(sensor.at(wish.old))
        if reply.register is None or not (yield from sensor.query.settle(sensor.at(wish.old))):
            absent.append(sensor.name)
    if absent:
        return BaudrateReport(BaudrateEnding.ABSENT, names=tuple(absent))
    for n in range(ECHO_READS):
        if echo_known() or not wish.sensors:
            break
        sensor = wish.sensors[n % len(wish.sensors)]
        yield from sensor.query.read_register(sensor.at(wish.old))
    if wish.sensors and not echo_known():
        return BaudrateReport(BaudrateEnding.DEAF)
    return BaudrateReport(BaudrateEnding.FREE) if wish.dry_run else None


def _one_by_one(wish: RateWish, where: Where) -> Steps[BaudrateReport]:
    for n, sensor in enumerate(wish.sensors):
        exception, rate, twins = yield from write_rate(sensor, wish.old, wish.to)
        where[sensor.name] = rate
        if twins:
            return (yield from _twins(wish, n, where))
        if rate == wish.to:
            continue
        if n == 0 and rate == wish.old:
            back = yield from restore_rate(sensor, wish.old, wish.to)
            where[sensor.name] = back
            if back != wish.old:
                return BaudrateReport(BaudrateEnding.UNVERIFIED, where, (sensor.name,), exception)
            ended = BaudrateEnding.CANARY if exception is None else BaudrateEnding.REFUSED
            canary = BaudrateReport(ended, where, (sensor.name,), exception)
            if wish.touched(n) == (sensor,):
                return canary
            report = yield from roll_back(wish.touched(n), wish.old, wish.to, where)
            return canary if report.ended is BaudrateEnding.ROLLED_BACK else report
        return (yield from roll_back(wish.touched(n), wish.old, wish.to, where))
    return BaudrateReport(BaudrateEnding.MOVED, where)


def _twins(wish: RateWish, last: int, where: Where) -> Steps[BaudrateReport]:
    """Move all sensors back, because the last one written turned out to be two."""
    report = yield from roll_back(wish.touched(last), wish.old, wish.to, where)
    names, back = (wish.sensors[last].name,), report.ended is BaudrateEnding.ROLLED_BACK
    return replace(report, ended=BaudrateEnding.TWINS, names=names) if back else report


def _all_written(wish: RateWish, where: Where) -> Steps[BaudrateReport]:
    for n, sensor in enumerate(wish.sensors):
        exception = yield from write(sensor.at(wish.old), sensor.register, sensor.code(wish.to), sensor.query)
        says, rate = yield from find_rate(sensor, (wish.to, wish.old))
        where[sensor.name] = rate
        if exception is not None or rate is None or says != sensor.code(wish.to):
            return (yield from roll_back(wish.touched(n), wish.old, wish.to, where))
        if rate == wish.to and (yield from sensor.query.read_register(sensor.at(wish.old))).answers:
            return (yield from _twins(wish, n, where))
    pending = tuple(name for name, rate in where.items() if rate != wish.to)
    return BaudrateReport(BaudrateEnding.PENDING if pending else BaudrateEnding.MOVED, where, pending)


def write_rate(sensor: RateSensor, old: int, to: int) -> Steps[tuple[int | None, int | None, bool]]:
    """Write another rate to a sensor; return the code of an exception, and the rate at which it answers then.

    The third says that it answers at both: there are two of this slave id.
    """
    exception = yield from write(sensor.at(old), sensor.register, sensor.code(to), sensor.query)
    found = yield from verify(sensor.at(old), sensor.at(to), sensor.query)
    if found.new.answers:
        return exception, to, found.old.answers
    return exception, old if found.old.answers else None, False


def find_rate(sensor: RateSensor, rates: Sequence[int], *, tries: int = TRIES) -> Steps[tuple[int | None, int | None]]:
    """Look for a sensor at these rates; return the content of its rate register, and the rate it answers at."""
    for _ in range(tries):
        for rate in rates:
            reply = yield from sensor.query.read_register(sensor.at(rate), None, register=sensor.register)
            if reply.answers:
                return reply.register, rate
    return None, None


def restore_rate(sensor: RateSensor, rate: int, other: int) -> Steps[int | None]:
    """Bring one sensor to `rate`, and its register; return the rate it answers at, None if it is not found."""
    says, at = yield from find_rate(sensor, (other, rate))  # there first: of two of this id one may have moved
    if at is None or (at == rate and says == sensor.code(rate)):
        return at
    if at == other:
        _, at, _ = yield from write_rate(sensor, other, rate)
        if at != rate:
            return at
    # Of two of this id the other one may have stored the rate and be here still, whatever the first to answer says.
    return rate if (yield from write_back(sensor, rate)) else None


def write_back(sensor: RateSensor, rate: int) -> Steps[bool]:
    """Write `rate` to a sensor that answers at it; return whether its register has it then."""
    yield from write(sensor.at(rate), sensor.register, sensor.code(rate), sensor.query)
    for _ in range(TRIES):
        reply = yield from sensor.query.read_register(sensor.at(rate), PATIENT, register=sensor.register)
        if reply.register == sensor.code(rate):
            return True
    return False


def roll_back(sensors: Sequence[RateSensor], rate: int, other: int, where: Where) -> Steps[BaudrateReport]:
    """Bring these sensors to `rate`, for up to `ROLL_BACK`; `where` learns where they are.

    All are looked for at the other rate in the end, after `VERIFY`, during which none is polled.
    """
    until: float | None = None
    missing = list(sensors)
    while missing:
        for sensor in tuple(missing):
            where[sensor.name] = yield from restore_rate(sensor, rate, other)
            if where[sensor.name] == rate:
                missing.remove(sensor)
            now = sensor.query.clock.now
            until = now + ROLL_BACK if until is None else until
            if now > until:
                return BaudrateReport(BaudrateEnding.UNVERIFIED, where, tuple(each.name for each in missing))
        if missing:
            yield Hold(missing[0].query.clock.now + FIRST_PAUSE)
        else:
            missing = yield from _left_behind(sensors, other)
    return BaudrateReport(BaudrateEnding.ROLLED_BACK, where)


def _left_behind(sensors: Sequence[RateSensor], rate: int) -> Steps[list[RateSensor]]:
    """Return the sensors that still answer at the rate that all others have left: they did not take the last write."""
    yield Hold(sensors[0].query.clock.now + VERIFY)
    left = []
    for sensor in sensors:
        reply = yield from sensor.query.read_register(sensor.at(rate))
        if reply.answers:
            left.append(sensor)
    return left
