"""Sensors of a change of rate that is still open: undone, or awaited, however long it takes. Pure.

What the daemon did not live to finish is undone, unless every sensor is at the new rate already. Sensors that have
stored the new rate and want their power switched are asked there until they come up; nothing is written to them. Where
somebody answers at the old rate too there are two of that slave id, and one of them has still to come.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lfs10d.jobs.baudrate import FIRST_PAUSE, Ended, RateVerdict, found_at, restored, rolled_back
from lfs10d.jobs.course import Aside
from lfs10d.jobs.job import Hold

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence

    from lfs10d.jobs.baudrate import Sensor
    from lfs10d.jobs.course import Step


@dataclass(frozen=True, slots=True)
class CameUp:
    """A sensor answers at the new rate."""

    name: str


@dataclass(frozen=True, slots=True)
class Twins:
    """A sensor answers at both rates: it is two."""

    name: str


def undo(
    sensors: Sequence[Sensor], rate: int, other: int, *, longest_pause: float, finish: bool
) -> Generator[Step, Any, RateVerdict]:
    """Find every sensor after a change of rate that was cut short, and bring it to `rate`, however long it takes.

    With `finish` they are left where they are if all of them answer at the `other` rate. What was not found in the
    first look goes aside.
    """
    where: dict[str, int | None] = {}
    if finish:
        for sensor in sensors:
            _, where[sensor.name] = yield from found_at(sensor, (rate, other))
            if where[sensor.name] == rate:
                break
        if len(where) == len(sensors) and all(at == other for at in where.values()):
            return RateVerdict(Ended.MOVED, where)
    verdict = yield from rolled_back(sensors, rate, other, where, once_more=False)
    pause = min(FIRST_PAUSE, longest_pause)
    while verdict.ended is not Ended.ROLLED_BACK:
        yield Aside(verdict)
        missing = [sensor for sensor in sensors if where[sensor.name] != rate]
        yield Hold(missing[0].asking.clock.now + pause)
        pause = min(2 * pause, longest_pause)
        for sensor in missing:
            where[sensor.name] = yield from restored(sensor, rate, other)
        names = tuple(sensor.name for sensor in missing if where[sensor.name] != rate)
        verdict = RateVerdict(Ended.UNVERIFIED if names else Ended.ROLLED_BACK, where, names)
    return verdict


def await_power(
    sensors: Sequence[Sensor], old: int, to: int, *, longest_pause: float
) -> Generator[Step, Any, RateVerdict]:
    """Ask sensors that want a power cycle at the new rate until all have come up there; each goes aside.

    So does, once, each that is two.
    """
    missing = list(sensors)
    twins: set[str] = set()
    pause = min(FIRST_PAUSE, longest_pause)
    while missing:
        for sensor in tuple(missing):
            reply = yield from sensor.asking.who(sensor.at(to))
            if not reply.answers:
                continue
            if not (yield from sensor.asking.who(sensor.at(old))).answers:
                missing.remove(sensor)
                yield Aside(CameUp(sensor.name))
            elif sensor.name not in twins:
                twins.add(sensor.name)
                yield Aside(Twins(sensor.name))
        if missing:
            yield Hold(missing[0].asking.clock.now + pause)
            pause = min(2 * pause, longest_pause)
    return RateVerdict(Ended.MOVED, {sensor.name: to for sensor in sensors})
