"""Open changes of the line's rate: finished where every sensor is at the new rate, else undone."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence
from functools import partial
from math import inf
from typing import Any

from lfs10d.line.jobs.procedure import Steps
from lfs10d.reading import Purpose
from lfs10d.reconfiguration import baudrate, baudrate_answers
from lfs10d.reconfiguration.journal import OpenBaudrate
from lfs10d.reconfiguration.procedure_run import ProcedureRun
from lfs10d.reconfiguration.procedures.baudrate import (
    FIRST_PAUSE,
    ROLL_BACK,
    BaudrateEnding,
    BaudrateReport,
    RateSensor,
    Where,
)
from lfs10d.reconfiguration.procedures.recover_baudrate import (
    CameUp,
    StillLost,
    Twins,
    await_lost,
    await_power,
    look_back,
    put_back,
)
from lfs10d.reconfiguration.runner import ChangeRunner

log = logging.getLogger(__name__)


def newest(runner: ChangeRunner) -> int:
    """Return the number of the newest open change of the rate, 0 if there is none: older ones end with it."""
    return max((change.number for change in baudrate.open_changes(runner)), default=0)


async def follow(runner: ChangeRunner, change: OpenBaudrate, run: ProcedureRun) -> None:
    """Look for the sensors of an open change; finish it, or undo what a crash interrupted."""
    if change.answered and change.facts.pending is not None:
        await _await_power(runner, change, list(change.facts.pending), run)
    else:
        await _Undo(runner, change, run).carry_out()


async def _await_power(runner: ChangeRunner, change: OpenBaudrate, pending: list[str], run: ProcedureRun) -> None:
    """Follow sensors that have stored the new rate until each comes up there."""
    old, to = change.facts.old, change.facts.to
    sensors = baudrate.rate_sensors(runner, pending, run.clock)
    steps = await_power(sensors, old, to, longest_pause=runner.running().config.poll.probe_interval_max)
    async for awaited in run.carry_out(steps, line_rate=0, share=1.0, purpose=Purpose.PROBE):
        if isinstance(awaited, CameUp):
            if runner.running().config.line.baudrate != to:
                await baudrate.save_rate(runner, old, to)
            pending.remove(awaited.name)
            await runner.journalled(partial(runner.journal.set_pending, change.number, tuple(pending)))
        elif isinstance(awaited, Twins):
            baudrate.announce_twins(runner, awaited.name, sensors)
    if run.result is not None:
        await _settle(runner, change, run.result)


class _Undo:
    """Sets sensors back to the old rate: at once if they answer, else when found, within the share of probes."""

    def __init__(self, runner: ChangeRunner, change: OpenBaudrate, run: ProcedureRun) -> None:
        self._runner = runner
        self._change = change
        self._run = run
        self._old, self._to = change.facts.old, change.facts.to
        self._sensors = baudrate.rate_sensors(runner, [move.device for move in change.moves], run.clock)
        self._where: Where = {}
        self._report: BaudrateReport | None = None
        self._twins: set[str] = set()
        """Sensors for which a second one with the same id was announced."""

    async def carry_out(self) -> None:
        """Return when the change is closed, or the port was lost."""
        longest = self._runner.running().config.poll.probe_interval_max
        found = self._sensors
        may_finish, give_up_at, pause = not self._change.answered, inf, min(FIRST_PAUSE, longest)
        while True:
            own = self._runner.running().config.line.baudrate
            looks = look_back(found, self._old, self._to, self._where, own=own)
            if await self._result_of(looks, share=1.0, excludes=_slaves(found)) is None:
                return
            if may_finish and all(at == self._to for at in self._where.values()):
                await _settle(self._runner, self._change, BaudrateReport(BaudrateEnding.MOVED, self._where))
                return
            if may_finish:
                give_up_at = self._run.clock.now + ROLL_BACK
            report = self._report = await self._put_back(found)
            if report is None:
                return
            if report.ended is not BaudrateEnding.UNVERIFIED:
                await _settle(self._runner, self._change, report)
                return
            if self._old in self._where.values() and own != self._old:
                await baudrate.save_rate(self._runner, self._to, self._old)  # those that are back are polled
            may_finish = False
            next_found = await self._await_lost(pause, longest, give_up_at)
            if next_found is None:
                return
            found, pause = next_found, min(2 * pause, longest)

    async def _put_back(self, found: Sequence[RateSensor]) -> BaudrateReport | None:
        """Bring sensors to the old rate; return the outcome, None where the port was lost."""
        away = [sensor for sensor in found if self._where[sensor.name] != self._old]
        here = [sensor for sensor in found if self._where[sensor.name] == self._old]
        steps = put_back(away, self._old, self._to, self._where)
        if await self._result_of(steps, share=1.0, excludes=_slaves(away)) is None:
            return None
        # Of two sensors of one id one may have moved.
        report: BaudrateReport | None = await self._result_of(put_back(here, self._old, self._to, self._where))
        return report

    async def _await_lost(self, pause: float, longest: float, give_up_at: float) -> tuple[RateSensor, ...] | None:
        """Return the first of the lost sensors that are found, None where the port was lost."""
        steps = await_lost(
            [sensor for sensor in self._sensors if self._where[sensor.name] != self._old],
            self._old,
            self._to,
            self._where,
            own=self._runner.running().config.line.baudrate,
            pause=pause,
            longest_pause=longest,
            give_up_at=inf if self._change.answered else give_up_at,
        )
        found: tuple[RateSensor, ...] | None = await self._result_of(steps, share=1.0, purpose=Purpose.PROBE)
        return found

    async def _result_of(self, steps: Steps[Any], **settings: Any) -> Any:  # noqa: ANN401 - a procedure's
        """Run a procedure after the one before it; return its result, None where the port was lost."""
        async for awaited in self._run.carry_out(steps, line_rate=0, **settings):
            if isinstance(awaited, Twins) and awaited.name not in self._twins:
                self._twins.add(awaited.name)
                baudrate.announce_twins(self._runner, awaited.name, self._sensors)
            elif isinstance(awaited, StillLost) and self._report is not None:
                result = baudrate_answers.result(self._old, self._to, self._report)
                self._change = await self._runner.keep(self._change, result)
        return self._run.result


async def _settle(runner: ChangeRunner, change: OpenBaudrate, report: BaudrateReport) -> None:
    """Close a change whose sensors are all found, and the older ones that end with it."""
    old, to = change.facts.old, change.facts.to
    moved = report.ended is BaudrateEnding.MOVED
    before, after = (old, to) if moved else (to, old)
    if runner.running().config.line.baudrate != after:
        await baudrate.save_rate(runner, before, after)
    older = frozenset(each.number for each in baudrate.open_changes(runner) if each.number <= change.number)
    await runner.finish(older, change, baudrate_answers.result(old, to, report))
    if not moved:
        message = f"every sensor is at {old} baud: the change to {to} is dropped"
        log.warning("%s", message)
        runner.announce("change_dropped", {"key": "line.baudrate", "from": old, "to": to, "message": message})


def _slaves(sensors: Iterable[RateSensor]) -> frozenset[int]:
    return frozenset(sensor.slave for sensor in sensors)
