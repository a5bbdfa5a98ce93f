"""Changes that are open: their sensors are looked for until each is found; then the change is finished, or dropped."""

from __future__ import annotations

import asyncio
import logging
from functools import partial
from typing import TYPE_CHECKING

from lfs10d.command import Result, failed
from lfs10d.errors import ConfigError, StateError
from lfs10d.line.jobs.procedure import Finished, ProcedureClock
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Purpose
from lfs10d.reconfiguration import adopt, readdress_answers
from lfs10d.reconfiguration.journal import Endpoint, Move, OpenChange, ResultRecord, call_of
from lfs10d.reconfiguration.procedure_run import ProcedureRun
from lfs10d.reconfiguration.procedures.follow import follow
from lfs10d.reconfiguration.procedures.readdress import ReaddressEnding, ReaddressReport, ReaddressWish
from lfs10d.system.tasks import BackgroundTasks
from lfs10d.telemetry import command_log

if TYPE_CHECKING:
    from lfs10d.reconfiguration.baudrate import BaudrateChange
    from lfs10d.reconfiguration.readdress import Readdress
    from lfs10d.reconfiguration.reconfiguration import Reconfiguration

log = logging.getLogger(__name__)

KEPT_PAUSE = 30.0
"""After so many s a fact that could not be put on the disk is tried again."""
_OVERTAKEN = "the daemon ended before this was over; {device} has been told another time to move since"


class Recovery:
    """Looks for the sensors of open changes, one task for each change; a part of `Reconfiguration`."""

    def __init__(self, physical: Reconfiguration, moves: Readdress, rates: BaudrateChange) -> None:
        self._physical = physical
        self._moves = moves
        self._rates = rates
        self._tasks = BackgroundTasks()
        self._followed: dict[int, tuple[ProcedureRun, asyncio.Task[None]]] = {}

    def begin(self, busy: frozenset[int]) -> None:
        """Look for the sensors of every open change that nobody looks for now and that has none of the `busy` ids."""
        newest = self._rates.newest()
        for change in self._physical.open:
            if change.kind == "baudrate" and change.number != newest:
                continue  # it ends with the newest
            if change.number not in self._followed and not change.slaves & busy:
                talk = self._physical.talk()
                task = self._tasks.start(
                    f"follow {change.number}", self._follow(change, talk), partial(self._left, change.number)
                )
                self._followed[change.number] = talk, task

    def _left(self, number: int, task: asyncio.Task[None]) -> None:
        if self._followed.get(number, (None, None))[1] is task:
            del self._followed[number]

    def leave(self, changes: frozenset[int]) -> None:
        """Stop looking for the sensors of these changes: more is to be written to them."""
        for number in changes & set(self._followed):
            talk, task = self._followed.pop(number)
            talk.halt()
            talk.go_on()
            task.cancel()

    def stop(self) -> None:
        """Send no new frame."""
        for talk, task in self._followed.values():
            talk.halt()
            task.cancel()

    async def _follow(self, change: OpenChange, talk: ProcedureRun) -> None:
        try:
            await (self._rates.follow if change.kind == "baudrate" else self._follow_move)(change, talk)
        except (StateError, ConfigError) as error:
            log.warning("%s", error)
            await asyncio.sleep(KEPT_PAUSE)
            self._followed.pop(change.number, None)  # else it would count as looked for
            asyncio.get_running_loop().call_soon(self._physical.follow)
        finally:
            talk.go_on()

    async def _follow_move(self, change: OpenChange, talk: ProcedureRun) -> None:
        physical = self._physical
        (move,) = change.moves
        slave = physical.running().slave(move.device) or adopt.newcomer(change, move)
        if slave is None:
            await self.drop(change, f"{move.device} is no longer configured")
            return
        profile = await physical.profile(slave.profile)
        now = physical.running()
        clock = ProcedureClock()
        here = Endpoint(slave=move.old.slave, baudrate=move.new.baudrate)
        steps = follow(
            here,
            move.new,
            physical.asking(slave, clock, line_rate=0, profile=profile),
            longest_pause=now.config.poll.probe_interval_max,
            before=None if here == move.old else move.old,
            newcomer=change.kind == "adopt",
        )
        talk.begin(steps, clock, line_rate=now.config.line.baudrate, share=1.0, errand=Purpose.PROBE)
        ending: ReaddressEnding | None = None
        while not isinstance(what := await talk.wanted(), Finished):
            if isinstance(what, ReaddressReport):
                if what.ending is not ending and what.ending in (ReaddressEnding.BOTH, ReaddressEnding.GARBAGE):
                    self._moves.tell_duplicate(move.device, move.old, move.new)
                ending = what.ending
                change = await self._seen(change, move, what, profile)
            talk.go_on()
        if what.result is not None:
            await self._found(change, move, what.result, profile)

    async def _seen(self, change: OpenChange, move: Move, verdict: ReaddressReport, profile: Profile) -> OpenChange:
        """Answer the request of a change that is not settled by the first look."""
        if change.answered:
            return change
        return await self.answered(change, readdress_answers.readdressed(move.device, _wish(move), verdict, profile))

    async def answered(self, change: OpenChange, answer: Result) -> OpenChange:
        """Answer the request of a change that stays open."""
        physical = self._physical
        told = physical.told(change.asked, answer)
        await physical.put(partial(physical.journal.keep, change.number, told))
        if told is not None:
            physical.respond(told)
        return change.model_copy(update={"answered": True})

    async def _found(self, change: OpenChange, move: Move, verdict: ReaddressReport, profile: Profile) -> None:
        """Finish a change whose sensor was found."""
        if verdict.ending is ReaddressEnding.MOVED:
            self.leave(self._physical.changes_of(move.device) - {change.number})  # they end with this one
            answer = readdress_answers.readdressed(move.device, _wish(move), verdict, profile)
            await self._physical.record(move.device, move.new, newcomer=adopt.entry(change))
            await self.finish(self._physical.changes_of(move.device), change, answer)
            self._moves.tell_moved(move.device, move.old, move.new)
            if change.answered and change.asked is not None:  # else its answer is in the log
                log.info("%s: found", command_log.line(change.asked.name, call_of(change.asked), answer))
        else:
            why = f"{move.device} answers at slave id {move.old.slave}, and its register does not say {move.new.slave}"
            await self.drop(change, why)

    async def drop(self, change: OpenChange, why: str) -> None:
        """Undo a change that did not take effect."""
        message = f"{why}: the change is dropped"
        await self.finish(frozenset({change.number}), change, failed("cancelled", f"the daemon ended; {message}"))
        log.warning("%s", message)
        for move in change.moves:
            facts = {"device": move.device, "from": move.old.slave, "to": move.new.slave}
            self._physical.tell("change_dropped", {"key": f"slaves.{move.device}.id", **facts, "message": message})

    async def finish(self, numbers: frozenset[int], change: OpenChange, answer: Result) -> None:
        """Close changes; the request of `change` is answered if it is not yet."""
        told = None if change.answered else self._physical.told(change.asked, answer)
        await self.close(numbers, change, told)
        if told is not None:
            self._physical.respond(told)

    async def close(self, numbers: frozenset[int], change: OpenChange, told: ResultRecord | None) -> None:
        """Close changes, with the answer to `change`; what others of them still owe their requests is told."""
        physical = self._physical
        overtaken = [
            physical.told(each.asked, failed("cancelled", _OVERTAKEN.format(device=", ".join(each.devices))))
            for each in physical.open
            if each.number in numbers - {change.number} and not each.answered
        ]
        await physical.put(partial(physical.journal.close, numbers, told, *overtaken))
        for each in overtaken:
            if each is not None:
                physical.respond(each)


def _wish(move: Move) -> ReaddressWish:
    return ReaddressWish(move.old, move.new.slave, ())
