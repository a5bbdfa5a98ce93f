"""Runs a change of sensors of any kind: journal, line, configuration, response. Knows no kind of change.

The steps of a change, each on the disk before the next begins: intent in the journal, write, verification, the fact in
`changes.yaml`, the journal closed, the answer.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Coroutine, Mapping
from functools import partial
from math import inf
from typing import Any, Protocol, TypeVar

from lfs10d.command import Command, Result, failed, rejected
from lfs10d.config.changes import Changes, Place, Values
from lfs10d.config.effective import Edit, Effective
from lfs10d.config.models import SlaveConfig
from lfs10d.errors import StateError
from lfs10d.line.jobs.procedure import ProcedureClock, Steps
from lfs10d.line.settings import device_specs
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reconfiguration.journal import (
    REMEMBERED_FOR_MS,
    C,
    CommandRecord,
    Endpoint,
    Journal,
    OpenChange,
    ResultRecord,
)
from lfs10d.reconfiguration.journal_commands import command_of, result_of, result_record
from lfs10d.reconfiguration.procedure_run import CHANGE_SHARE, ProcedureRun, Wire
from lfs10d.reconfiguration.procedures.identity_query import IdentityQuery
from lfs10d.reconfiguration.reservations import Reservations
from lfs10d.system.clock import Instant
from lfs10d.system.tasks import BackgroundTasks
from lfs10d.system.threads import run_in_thread
from lfs10d.telemetry.publication import EventType

log = logging.getLogger(__name__)
T = TypeVar("T")

REFUSALS_SAVED_AFTER = 10.0
"""Seconds until the results of commands that wrote nothing are saved together."""
OVERTAKEN = "the daemon ended before this change was finished; a later request has changed {device} since"


class Recall(Protocol):
    """Remembers a command of an earlier run; see `lfs10d.commands.responder.Responder.recall`."""

    def __call__(
        self, name: str, command: Command, result: Result | None, *, forget_in: float, respond: bool = False
    ) -> None:
        """Remember it for `forget_in` s; with `respond` answer it too."""


class ChangeRunner:
    """Carries out one change after the other. Used in the thread of the asyncio loop.

    `running()` is the configuration in force, `change` puts another into force, saved to disk first (it raises
    StateError where that fails), `learn` too, whether or not the disk keeps it; `wire()` is the line, of which a change
    takes `share`. `announce` publishes an event; `recall` has a command of an earlier life of the daemon remembered, or
    answered.
    """

    def __init__(  # noqa: PLR0913 - all that it touches of the daemon, each by one callable
        self,
        journal: Journal,
        *,
        running: Callable[[], Effective],
        change: Callable[[Edit], Awaitable[object]],
        learn: Callable[[Edit], Awaitable[object]],
        wire: Callable[[], Wire],
        announce: Callable[[EventType, Mapping[str, object]], None],
        recall: Recall,
        now: Callable[[], Instant],
        share: float = CHANGE_SHARE,
    ) -> None:
        self.journal = journal
        self.running = running
        self.change = change
        self.learn = learn
        self.wire = wire
        self.announce = announce
        self.ending = False
        self.reservations = Reservations(lambda: journal.open)
        self.underway: CommandRecord | None = None
        """The command under way."""
        self._recall = recall
        self._now = now
        self._share = share
        self._writing: asyncio.Future[Any] | None = None
        self._tasks = BackgroundTasks()
        self._saving: asyncio.Task[None] | None = None

    @property
    def open(self) -> tuple[OpenChange, ...]:
        """The changes whose sensors are still to be found."""
        return self.journal.open

    def id_changes_of(self, device: str) -> frozenset[int]:
        """Return the numbers of the open changes of a device's slave id."""
        changes = (change for change in self.open if change.kind != "baudrate")
        return frozenset(change.number for change in changes if device in change.devices)

    def timestamp(self) -> int:
        """Return the time in epoch milliseconds."""
        return self._now().ts()

    # -- procedures on the line

    def new_run(self) -> ProcedureRun:
        """Return a runner of procedures on the line, one after the other."""
        return ProcedureRun(self.wire(), self._share)

    async def profile(self, reference: str) -> Profile:
        """Return a profile by its name or path in the configuration; raises ConfigError where it cannot be read.

        That of a new sensor need not be any configured device's.
        """
        now = self.running()
        known = now.loaded.profiles.get(reference)
        if known is not None:
            return known
        folder = now.file.path.parent.absolute()
        return await run_in_thread(partial(load_profile, reference, relative_to=folder), "profile")

    def query(self, slave: SlaveConfig, clock: ProcedureClock, profile: Profile | None = None) -> IdentityQuery:
        """Return the query of a device. `profile` is a new sensor's; a configured device has its own."""
        now = self.running()
        profiles = now.loaded.profiles if profile is None else {slave.profile: profile}
        alone = now.config.model_copy(update={"slaves": (slave,)})
        (spec,) = device_specs(alone, profiles)
        return IdentityQuery(spec.profile, spec.codec, self.wire().pending, clock)

    async def perform(
        self,
        run: ProcedureRun,
        steps: Steps[Any],
        command: CommandRecord,
        intend: Callable[[Any], C],
        conclude: Callable[[Any, C | None], Coroutine[Any, Any, Result]],
        **settings: Any,  # noqa: ANN401 - those of Procedure
    ) -> Result:
        """Run a procedure to its end, its intent journalled before it writes; return the result of `conclude`.

        The end of the daemon cuts short what is under way on the line, but not the conclusion.
        """
        change: C | None = None
        self.underway = command
        try:
            async for intent in run.carry_out(steps, **settings):
                try:
                    change = await self.journalled(partial(intend, intent))
                except StateError as error:
                    run.answer = str(error)
            concluded = asyncio.ensure_future(conclude(run.result, change))
        except asyncio.CancelledError:
            run.stop()
            self.underway = None
            return await self._cut_short(command)
        try:
            return await asyncio.shield(concluded)
        except asyncio.CancelledError:
            return await concluded
        finally:
            self.underway = None
            run.resume()

    async def _cut_short(self, command: CommandRecord) -> Result:
        """Answer a command that is interrupted by the daemon's end; its change is recovered at the next start."""
        if self._writing is not None:
            await asyncio.wait([self._writing])
        mine = next((each for each in self.open if each.asked == command and not each.answered), None)
        if mine is None:
            return await self.refuse(command, rejected("cancelled", "the daemon is stopping; nothing was written"))
        result = failed("cancelled", "the daemon is stopping; it looks for the sensor at its next start")
        with contextlib.suppress(StateError):
            await self.journalled(partial(self.journal.keep, mine.number, self.record(command, result)))
        return result

    # -- the journal

    async def journalled(self, step: Callable[[], T]) -> T:
        """Run a step of the journal in a thread, after the one before it; it is not cancelled."""
        if self._writing is not None:
            await asyncio.wait([self._writing])
        self._writing = asyncio.ensure_future(run_in_thread(step, "journal"))
        try:
            return await asyncio.shield(self._writing)
        finally:
            self.reservations.update()

    def record(self, command: CommandRecord | None, result: Result) -> ResultRecord | None:
        """Return a result as a record of the journal; None if there is no command to answer."""
        return result_record(command, result, self.timestamp())

    async def refuse(self, command: CommandRecord, result: Result) -> Result:
        """Return the result of a command that wrote nothing, remembered for repeats.

        It is not waited for that the disk has it: a flood of such commands must not wear the disk out.
        """
        await self.journalled(partial(self.journal.note, self.record(command, result)))
        if self.ending:
            await self._save_noted()
        elif self._saving is None or self._saving.done():
            self._saving = self._tasks.start("journal", self._save_noted(REFUSALS_SAVED_AFTER))
        return result

    async def _save_noted(self, after: float = 0.0) -> None:
        if after:
            await asyncio.sleep(after)
        with contextlib.suppress(StateError):  # a repeat may be judged anew
            await self.journalled(self.journal.save)

    async def keep(self, change: C, result: Result) -> C:
        """Answer the command of a change that stays open; return the change as it is now."""
        record = self.record(change.asked, result)
        await self.journalled(partial(self.journal.keep, change.number, record))
        if record is not None:
            self._respond(record)
        return change.model_copy(update={"answered": True})

    async def finish(self, numbers: frozenset[int], change: OpenChange, result: Result) -> None:
        """Close changes, and answer the command of `change` unless it was answered."""
        record = None if change.answered else self.record(change.asked, result)
        await self.close(numbers, change, record)
        if record is not None:
            self._respond(record)

    async def close(self, numbers: frozenset[int], change: OpenChange, record: ResultRecord | None) -> None:
        """Close changes with the result of `change`; the commands of the others are answered as overtaken."""
        overtaken = [
            self.record(each.asked, failed("cancelled", OVERTAKEN.format(device=", ".join(each.devices))))
            for each in self.open
            if each.number in numbers - {change.number} and not each.answered
        ]
        await self.journalled(partial(self.journal.close, numbers, record, *overtaken))
        for each in overtaken:
            if each is not None:
                self._respond(each)

    async def drop(self, change: OpenChange, why: str) -> None:
        """Close a change that did not take effect."""
        message = f"{why}: the change is dropped"
        await self.finish(frozenset({change.number}), change, failed("cancelled", f"the daemon ended; {message}"))
        log.warning("%s", message)
        for move in change.moves:
            facts = {"device": move.device, "from": move.old.slave, "to": move.new.slave}
            self.announce("change_dropped", {"key": f"slaves.{move.device}.id", **facts, "message": message})

    # -- what holds from now on

    async def save_endpoint(self, device: str, endpoint: Endpoint, added: Values | None = None) -> None:
        """Save where a device was found, then poll it there; `added` is the entry of a new one."""

        def edit(now: Effective) -> Changes:
            if now.slave(device) is None:
                return now.changes if added is None else now.changes.adding(device, added, Place(endpoint.slave))
            return now.changes.moving(device, Place(endpoint.slave), now.file_values)

        await self.change(edit)

    def announce_duplicate(self, device: str, slave: int, former: int) -> None:
        """Announce that two sensors have the slave id `slave`, or had `former` both."""
        self.announce("duplicate_id", {"device": device, "slave": slave, "from": former})

    def announce_readdressed(self, device: str, former: int, slave: int) -> None:
        """Announce that a sensor has another slave id now."""
        self.announce("readdressed", {"device": device, "from": former, "to": slave})

    # -- commands of earlier lives

    def recall(self) -> None:
        """Restore the commands of earlier runs: those with a result for their repeats, and those without one yet."""
        now = self.timestamp()
        for record in self.journal.answers:
            forget_in = max(0.0, (record.at + REMEMBERED_FOR_MS - now) / 1000)
            self._recall(record.asked.name, command_of(record.asked), result_of(record), forget_in=forget_in)
        for change in self.open:
            if change.asked is not None and not change.answered:
                self._recall(change.asked.name, command_of(change.asked), None, forget_in=inf)

    def _respond(self, record: ResultRecord) -> None:
        """Answer a command of an earlier run, and its repeats."""
        forget_in = REMEMBERED_FOR_MS / 1000
        command, result = command_of(record.asked), result_of(record)
        self._recall(record.asked.name, command, result, forget_in=forget_in, respond=True)

    async def stop(self) -> None:
        """Start no further change; save what was only noted."""
        self._tasks.cancel_all()
        await self._save_noted()
