"""Recovers the sensors of an open change of the rate: sets them back, or waits for them without limit. Pure.

What the daemon did not live to finish is undone, unless every sensor is at the new rate already: what answers is put
back at once, what is lost is looked for until it is found and then put back too. Sensors that have
stored the new rate and need a power cycle are read there until they come up; nothing is written to them. Where a
sensor answers at the old rate too there are two of that slave id, and one of them is still to come.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf

from lfs10d.line.jobs.job import Hold
from lfs10d.line.jobs.procedure import Await, Steps
from lfs10d.reconfiguration.procedures.baudrate import (
    FIRST_PAUSE,
    BaudrateEnding,
    BaudrateReport,
    RateSensor,
    Where,
    find_rate,
    restore_rate,
    write_back,
)
from lfs10d.reconfiguration.procedures.identity_query import PATIENT
from lfs10d.system.dataclass import dataclass

PATIENT_EVERY = 4
"""In every fourth round a lost sensor gets a long time-out, at each rate in turn: it may be slow."""


@dataclass(frozen=True, slots=True)
class CameUp:
    """A sensor answers at the new rate."""

    name: str


@dataclass(frozen=True, slots=True)
class StillLost:
    """Some are not found again, and have not been for long."""


@dataclass(frozen=True, slots=True)
class Twins:
    """A sensor answers at both rates: it is two."""

    name: str


def look_back(sensors: Sequence[RateSensor], rate: int, other: int, where: Where, *, own: int) -> Steps[Where]:
    """Look once for each sensor after a change of rate that was cut short, at the line's `own` rate first.

    One that answers at `rate` and has stored another is written back at once, before it comes up there: none waits
    for one that is lost. `where` is updated and returned.
    """
    for sensor in sensors:
        says, at = yield from find_rate(sensor, _first(own, rate, other), tries=1)
        where[sensor.name] = at
        if at == rate and says != sensor.code(rate):
            yield from write_back(sensor, rate)
    return where


def put_back(sensors: Sequence[RateSensor], rate: int, other: int, where: Where) -> Steps[BaudrateReport]:
    """Bring those of these sensors that were found to `rate`; the report is of all in `where`.

    One that answers at the `other` rate too is two sensors: that is awaited, and it counts as being there.
    """
    for sensor in sensors:
        if where[sensor.name] is None:
            continue
        where[sensor.name] = yield from restore_rate(sensor, rate, other)
        if where[sensor.name] == rate and (yield from sensor.query.read_register(sensor.at(other))).answers:
            where[sensor.name] = other
            yield Await(Twins(sensor.name))
    names = tuple(name for name, at in where.items() if at != rate)
    return BaudrateReport(BaudrateEnding.UNVERIFIED if names else BaudrateEnding.ROLLED_BACK, dict(where), names)


def await_lost(
    sensors: Sequence[RateSensor],
    rate: int,
    other: int,
    where: Mapping[str, int | None],
    *,
    own: int,
    pause: float,
    longest_pause: float,
    give_up_at: float,
) -> Steps[tuple[RateSensor, ...]]:
    """Return the first of these sensors that can be put back, however long it takes; nothing is written.

    They are read after `pause` s, twice that ... up to `longest_pause`, at the line's `own` rate first, but where each
    was found if it was. One that answers at the `other` rate and has stored `rate` waits for its power cycle, and is
    waited for. From the time `give_up_at` on, once, `StillLost` is awaited.
    """
    rounds = 0
    while True:
        now = sensors[0].query.clock.now
        if now >= give_up_at:
            yield Await(StillLost())
            give_up_at = inf
        yield Hold(now + pause)
        pause = min(2 * pause, longest_pause)
        found: list[RateSensor] = []
        turn, rest = divmod(rounds, PATIENT_EVERY)
        for sensor in sensors:
            for n, asked in enumerate(_first(where[sensor.name] or own, rate, other)):
                timeout = PATIENT if rest == PATIENT_EVERY - 1 and turn % 2 == n else None
                reply = yield from sensor.query.read_register(sensor.at(asked), timeout, register=sensor.register)
                if reply.answers and not (asked == other and reply.register == sensor.code(rate)):
                    found.append(sensor)
                if reply.answers:
                    break
        if found:
            return tuple(found)
        rounds += 1


def _first(own: int, *rates: int) -> tuple[int, ...]:
    return tuple(sorted(rates, key=lambda each: each != own))


def await_power(sensors: Sequence[RateSensor], old: int, to: int, *, longest_pause: float) -> Steps[BaudrateReport]:
    """Read sensors that need a power cycle at the new rate until all have come up there; each is awaited.

    So is, once, each that is two.
    """
    missing = list(sensors)
    twins: set[str] = set()
    pause = min(FIRST_PAUSE, longest_pause)
    while missing:
        for sensor in tuple(missing):
            reply = yield from sensor.query.read_register(sensor.at(to))
            if not reply.answers:
                continue
            if not (yield from sensor.query.read_register(sensor.at(old))).answers:
                missing.remove(sensor)
                yield Await(CameUp(sensor.name))
            elif sensor.name not in twins:
                twins.add(sensor.name)
                yield Await(Twins(sensor.name))
        if missing:
            yield Hold(missing[0].query.clock.now + pause)
            pause = min(2 * pause, longest_pause)
    return BaudrateReport(BaudrateEnding.MOVED, {sensor.name: to for sensor in sensors})
