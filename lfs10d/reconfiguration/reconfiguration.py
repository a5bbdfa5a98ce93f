"""The one place of physical changes: each kind is a part of its own, built here; what they have in common is here."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Coroutine, Iterator, Mapping
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from lfs10d.command import Command, Result, failed, rejected
from lfs10d.config.changes import Changes, Place, Values
from lfs10d.config.effective import Edit, Effective
from lfs10d.config.models import Config, SlaveConfig
from lfs10d.errors import StateError
from lfs10d.line.jobs.procedure import Finished, ProcedureClock
from lfs10d.line.settings import device_specs
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reconfiguration import adopt, baudrate, readdress
from lfs10d.reconfiguration import journal as asked
from lfs10d.reconfiguration.adopt import Adopt
from lfs10d.reconfiguration.baudrate import BaudrateChange
from lfs10d.reconfiguration.journal import REMEMBERED_FOR_MS, CommandRecord, Endpoint, Journal, OpenChange, ResultRecord
from lfs10d.reconfiguration.locate import Locator
from lfs10d.reconfiguration.procedure_run import ProcedureRun, Wire
from lfs10d.reconfiguration.procedures.identity_query import IdentityQuery
from lfs10d.reconfiguration.readdress import Readdress
from lfs10d.reconfiguration.recovery import Recovery
from lfs10d.reconfiguration.reservations import Reservations
from lfs10d.system.clock import Instant
from lfs10d.system.tasks import BackgroundTasks
from lfs10d.system.threads import run_in_thread

if TYPE_CHECKING:
    from lfs10d.reconfiguration.adopt import AdoptRequest

log = logging.getLogger(__name__)
T = TypeVar("T")

REFUSALS_SAVED_AFTER = 10.0
"""Seconds after which the answers to requests that wrote nothing are on the disk, all in one step."""


class Recall(Protocol):
    """Remembers a request of an earlier life; see `lfs10d.commands.dispatcher.Dispatcher.recall`."""

    def __call__(
        self, name: str, call: Command, answer: Result | None, *, forget_in: float, tell: bool = False
    ) -> None:
        """Remember it for `forget_in` s; with `tell` answer it too."""


class Reconfiguration:
    """Physical changes of one line. Used in the thread of the asyncio loop.

    `running()` is the configuration that holds, `change` puts another into force, `learn` too, whether or not the disk
    keeps it; `wire()` is the line. `tell` publishes an event, `act` what the line is busy with (None: as usual),
    `repoll` puts into force what is `polled` now; `recall` has a request of an earlier life of the daemon remembered,
    or answered.
    """

    def __init__(  # noqa: PLR0913 - all that it touches of the daemon, each by one callable
        self,
        journal: Journal,
        *,
        running: Callable[[], Effective],
        change: Callable[[Edit], Awaitable[object]],
        learn: Callable[[Edit], Awaitable[object]],
        wire: Callable[[], Wire],
        tell: Callable[[str, Mapping[str, object]], None],
        recall: Recall,
        now: Callable[[], Instant],
        act: Callable[[str | None], None],
        repoll: Callable[[], None],
    ) -> None:
        self.journal = journal
        self.running = running
        self.change = change
        self.learn = learn
        self.wire = wire
        self.tell = tell
        self._recall = recall
        self.now = now
        self.ending = False
        self._reserving = Reservations(lambda: journal.open)
        self._writing: asyncio.Future[Any] | None = None
        self._underway: CommandRecord | None = None
        self._tasks = BackgroundTasks()
        self._saving: asyncio.Task[None] | None = None
        self._act = act
        self._moves = Readdress(self)
        self._rates = BaudrateChange(self)
        self._adoption = Adopt(self)
        self._following = Recovery(self, self._moves, self._rates)
        self.drop, self.answered = self._following.drop, self._following.answered
        self.close, self.finish = self._following.close, self._following.finish
        self._locating = Locator(self, repoll)
        trouble = journal.take()
        if trouble is not None:
            log.error("%s", trouble)
        self._reserving.update()

    def recall(self) -> None:
        """Have the requests of earlier lives remembered for their repeats, and those that have no answer yet."""
        ts = self.now().ts()
        for told in self.journal.answers:
            self.respond(told, max(0.0, (told.at + REMEMBERED_FOR_MS - ts) / 1000), tell=False)
        for change in self.journal.open:
            if change.asked is not None and not change.answered:
                self._recall(change.asked.name, asked.call_of(change.asked), None, forget_in=inf)

    def respond(self, told: ResultRecord, forget_in: float = REMEMBERED_FOR_MS / 1000, *, tell: bool = True) -> None:
        """Answer a request of an earlier life, with `tell`, and its repeats."""
        call = asked.call_of(told.asked)
        self._recall(told.asked.name, call, asked.answer_of(told), forget_in=forget_in, tell=tell)

    # -- the place

    @property
    def open(self) -> tuple[OpenChange, ...]:
        """The changes whose sensors are still to be found."""
        return self.journal.open

    def changes_of(self, device: str) -> frozenset[int]:
        """Return the numbers of the open changes of a device's slave id."""
        moves = (change for change in self.journal.open if change.kind != "baudrate")
        return frozenset(change.number for change in moves if device in change.devices)

    @property
    def busy(self) -> Result | None:
        """The rejection of whatever must wait until a scan or a physical change is over, None if nothing must."""
        return self._reserving.busy

    @contextlib.contextmanager
    def place(self, request: str, slaves: frozenset[int] = frozenset()) -> Iterator[None]:
        """Hold the one place that scans and physical changes share; see `lfs10d.reconfiguration.reservations`."""
        try:
            with self._reserving.held(request, slaves):
                yield
        finally:
            self.follow()

    def polled(self) -> Config:
        """Return the configuration for the line: without the devices that it must be asked for first."""
        config, withheld = self.running().polled, self._locating.withheld()
        slaves = tuple(slave for slave in config.slaves if slave.name not in withheld)
        return config.model_copy(update={"slaves": slaves})

    def reserved(self) -> Mapping[int, str]:
        """Return the slave ids that nobody may be given now, with the reason."""
        return self._reserving.reserved

    # -- the requests

    async def baudrate(self, to: int, *, power_cycle: bool, dry_run: bool, call: Command) -> Result:
        """Move every sensor and the port to another rate, verified, or back."""
        who = asked.asked_by(baudrate.NAME, call)
        if (busy := self.busy) is not None:
            return await self.refused(who, busy)
        with self.place(baudrate.NAME):
            self._act(baudrate.ACTIVITY)
            try:
                return await self._rates.perform(to, power_cycle=power_cycle, dry_run=dry_run, asked=who)
            finally:
                self._act(None)

    async def adopt(self, wanted: AdoptRequest, call: Command) -> Result:
        """Take in a factory-new sensor: a free id, the line's rate, and it is polled."""
        who = asked.asked_by(adopt.NAME, call)
        if (busy := self.busy or self._rates.unsettled()) is not None:
            return await self.refused(who, busy)
        with self.place(adopt.NAME, wanted.slaves):
            return await self._adoption.perform(wanted, who)

    async def readdress(self, device: str, to: int, *, dry_run: bool, call: Command) -> Result:
        """Give a sensor another slave id, verified."""
        who = asked.asked_by(readdress.NAME, call)
        slave = self._moves.fit(device, to)
        if isinstance(slave, Result):
            return await self.refused(who, slave)
        if (busy := self.busy or self._rates.unsettled(device)) is not None:
            return await self.refused(who, busy)
        with self.place(readdress.NAME, frozenset({slave.id, to})):
            return await self._moves.perform(slave, to, who, dry_run=dry_run)

    async def refused(self, who: CommandRecord, answer: Result) -> Result:
        """Return the answer to a request of which nothing was written, kept for its repeats.

        It is not waited for that the disk has it: a flood of such requests must not wear the disk out.
        """
        await self.put(partial(self.journal.note, self.told(who, answer)))
        if self.ending:
            await self._save_noted()
        elif self._saving is None or self._saving.done():
            self._saving = self._tasks.start("journal", self._save_noted(REFUSALS_SAVED_AFTER))
        return answer

    async def _save_noted(self, after: float = 0.0) -> None:
        if after:
            await asyncio.sleep(after)
        with contextlib.suppress(StateError):  # a repeat may be judged anew
            await self.put(self.journal.save)

    # -- what the kinds of change have in common

    def talk(self) -> ProcedureRun:
        """Return what a course on the line is talked with by."""
        return ProcedureRun(self.wire())

    async def profile(self, word: str) -> Profile:
        """Return a profile by the configuration's word for it; raises ConfigError where it cannot be read.

        That of a newcomer need not be any configured device's.
        """
        now = self.running()
        known = now.loaded.profiles.get(word)
        if known is not None:
            return known
        folder = now.file.path.parent.absolute()
        return await run_in_thread(partial(load_profile, word, relative_to=folder), "profile")

    def asking(
        self, slave: SlaveConfig, clock: ProcedureClock, line_rate: int | None = None, profile: Profile | None = None
    ) -> IdentityQuery:
        """Return how a device is asked; with a `line_rate` that no line has, its rate is told each time.

        `profile` is a newcomer's; a configured device has its own.
        """
        now = self.running()
        profiles = now.loaded.profiles if profile is None else {slave.profile: profile}
        alone = now.config.model_copy(update={"slaves": (slave,)})
        (spec,) = device_specs(alone, profiles)
        rate = now.config.line.baudrate if line_rate is None else line_rate
        return IdentityQuery(spec.profile, spec.codec, self.wire().unanswered, clock, line_rate=rate)

    async def carried_out(
        self,
        talk: ProcedureRun,
        asked: CommandRecord,
        intend: Callable[[Any], OpenChange],
        conclude: Callable[[Any, OpenChange | None], Coroutine[Any, Any, Result]],
    ) -> Result:
        """Hear what a course wants, its intent put on the disk, until it is over; return what is concluded of it.

        The end of the daemon cuts short what is under way on the line, but not the conclusion.
        """
        change: OpenChange | None = None
        self._underway = asked
        try:
            while not isinstance(what := await talk.wanted(), Finished):
                why = None
                try:
                    change = await self.put(partial(intend, what))
                except StateError as error:
                    why = str(error)
                talk.go_on(why)
            concluded = asyncio.ensure_future(conclude(what.result, change))
        except asyncio.CancelledError:
            talk.halt()
            talk.go_on()
            self._underway = None
            return await self._cut_short(asked)
        try:
            return await asyncio.shield(concluded)
        except asyncio.CancelledError:
            return await concluded
        finally:
            self._underway = None
            talk.go_on()

    async def _cut_short(self, asked: CommandRecord) -> Result:
        """Answer a request that the daemon's end cuts short; what it began is settled at the next start."""
        if self._writing is not None:
            await asyncio.wait([self._writing])
        mine = next((each for each in self.journal.open if each.asked == asked and not each.answered), None)
        if mine is None:
            return await self.refused(asked, rejected("cancelled", "the daemon is ending; nothing was written"))
        answer = failed("cancelled", "the daemon is ending; at its next start it looks where the sensor is")
        with contextlib.suppress(StateError):
            await self.put(partial(self.journal.keep, mine.number, self.told(asked, answer)))
        return answer

    def told(self, who: CommandRecord | None, answer: Result) -> ResultRecord | None:
        """Return an answer as the journal keeps it; None if nobody asked."""
        return asked.told(who, answer, self.now().ts())

    async def put(self, step: Callable[[], T]) -> T:
        """Have a step of the journal done aside, after the one before it; it is not cut short."""
        if self._writing is not None:
            await asyncio.wait([self._writing])
        self._writing = asyncio.ensure_future(run_in_thread(step, "journal"))
        try:
            return await asyncio.shield(self._writing)
        finally:
            self._reserving.update()

    async def record(self, device: str, spot: Endpoint, newcomer: Values | None = None) -> None:
        """Have the device polled where it was found, on the disk first; a `newcomer` is what is said of a new one."""

        def edit(now: Effective) -> Changes:
            if now.slave(device) is None:
                return now.changes if newcomer is None else now.changes.adding(device, newcomer, Place(spot.slave))
            return now.changes.moving(device, Place(spot.slave), now.said)

        await self.change(edit)

    # -- what else happens

    def follow(self) -> None:
        """Look for the sensors of every open change that nobody looks for now."""
        if self.ending:
            return
        self._locating.begin()
        self._following.begin(self._reserving.brought)

    def leave(self, changes: frozenset[int]) -> None:
        """Stop looking for the sensors of these changes: more is to be written to them."""
        self._following.leave(changes)

    async def reconfigured(self, before: Config, after: Config) -> None:
        """Take note of another configuration: open changes of devices that are gone are closed."""
        devices = {slave.name for slave in before.slaves} - {slave.name for slave in after.slaves}
        for change in self.journal.open:
            if self._underway is not None and change.asked == self._underway:
                continue  # its own request ends and answers it
            if change.devices and change.devices <= devices:
                self.leave(frozenset({change.number}))
                with contextlib.suppress(StateError):
                    await self.drop(change, f"{', '.join(sorted(change.devices))} was removed")
        if not self.ending:
            self._locating.begin()

    async def stop(self) -> None:
        """Send no new frame of any change."""
        self.ending = True
        self._locating.stop()
        self._following.stop()
        self._tasks.cancel_all()
        await self._save_noted()
