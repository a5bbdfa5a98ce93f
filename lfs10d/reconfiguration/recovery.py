"""Recovers open changes: looks for their sensors until each is found, then finishes the change or drops it."""

from __future__ import annotations

import asyncio
import logging
from functools import partial

from lfs10d.command import Result
from lfs10d.errors import ConfigError, StateError
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Purpose
from lfs10d.reconfiguration import adopt, baudrate_recovery, readdress_answers
from lfs10d.reconfiguration.journal import Endpoint, Move, OpenAdopt, OpenChange, OpenReaddress
from lfs10d.reconfiguration.journal_commands import command_of
from lfs10d.reconfiguration.procedure_run import ProcedureRun
from lfs10d.reconfiguration.procedures.follow import follow
from lfs10d.reconfiguration.procedures.readdress import ReaddressEnding, ReaddressReport, ReaddressWish
from lfs10d.reconfiguration.runner import ChangeRunner
from lfs10d.reconfiguration.searches import Searches
from lfs10d.telemetry import command_log

log = logging.getLogger(__name__)

RETRY_AFTER = 30.0
"""Seconds after which a failed write to the disk is tried again."""


class Recovery:
    """Looks for the sensors of open changes, one task for each change."""

    def __init__(self, runner: ChangeRunner) -> None:
        self._runner = runner
        self._searches: Searches[int] = Searches(runner.new_run)

    def begin(self) -> None:
        """Search for the sensors of every open change, unless that is under way or the present command uses their ids.

        Once the daemon is ending it does nothing.
        """
        if self._runner.ending:
            return
        newest, busy = baudrate_recovery.newest(self._runner), self._runner.reservations.brought
        for change in self._runner.open:
            if change.kind == "baudrate" and change.number != newest:
                continue  # it ends with the newest
            if change.number not in self._searches and not change.slaves & busy:
                self._searches.begin(change.number, f"follow {change.number}", partial(self._follow, change))

    def leave(self, changes: frozenset[int]) -> None:
        """Stop searching for the sensors of these changes: a new command writes to them."""
        self._searches.end(changes)

    def stop(self) -> None:
        """Send no new frame."""
        self._searches.end_all()

    async def _follow(self, change: OpenChange, run: ProcedureRun) -> None:
        try:
            if change.kind == "baudrate":
                await baudrate_recovery.follow(self._runner, change, run)
            else:
                await self._follow_id(change, run)
        except (StateError, ConfigError) as error:
            log.warning("%s", error)
            await asyncio.sleep(RETRY_AFTER)
            asyncio.get_running_loop().call_soon(self.begin)
        finally:
            run.resume()

    async def _follow_id(self, change: OpenReaddress | OpenAdopt, run: ProcedureRun) -> None:
        """Look for a sensor at its old and its new slave id."""
        runner = self._runner
        (move,) = change.moves
        slave = runner.running().slave(move.device) or adopt.new_slave(change)
        if slave is None:
            await runner.drop(change, f"{move.device} is no longer configured")
            return
        profile = await runner.profile(slave.profile)
        now = runner.running()
        here = Endpoint(slave=move.old.slave, baudrate=move.new.baudrate)
        steps = follow(
            here,
            move.new,
            runner.query(slave, run.clock, profile),
            longest_pause=now.config.poll.probe_interval_max,
            before=None if here == move.old else move.old,
            newcomer=change.kind == "adopt",
        )
        ending: ReaddressEnding | None = None
        rate = now.config.line.baudrate
        async for awaited in run.carry_out(steps, line_rate=rate, share=1.0, purpose=Purpose.PROBE):
            if isinstance(awaited, ReaddressReport):
                if awaited.ending is not ending and awaited.ending in (ReaddressEnding.BOTH, ReaddressEnding.GARBAGE):
                    runner.announce_duplicate(move.device, move.new.slave, move.old.slave)
                ending = awaited.ending
                if not change.answered:
                    change = await runner.keep(change, _result(move, awaited, profile))
        if run.result is not None:
            await self._found(change, move, run.result, profile)

    async def _found(
        self, change: OpenReaddress | OpenAdopt, move: Move, report: ReaddressReport, profile: Profile
    ) -> None:
        """Finish a change whose sensor was found."""
        runner = self._runner
        if report.ending is not ReaddressEnding.MOVED:
            why = f"{move.device} answers at slave id {move.old.slave}, and its register does not hold {move.new.slave}"
            await runner.drop(change, why)
            return
        self.leave(runner.id_changes_of(move.device) - {change.number})  # they end with this one
        result = _result(move, report, profile)
        await runner.save_endpoint(move.device, move.new, added=adopt.entry(change))
        await runner.finish(runner.id_changes_of(move.device), change, result)
        runner.announce_readdressed(move.device, move.old.slave, move.new.slave)
        if change.answered and change.asked is not None:  # else its result is in the log
            log.info("%s: found", command_log.line(change.asked.name, command_of(change.asked), result))


def _result(move: Move, report: ReaddressReport, profile: Profile) -> Result:
    return readdress_answers.result(move.device, ReaddressWish(move.old, move.new.slave, ()), report, profile)
