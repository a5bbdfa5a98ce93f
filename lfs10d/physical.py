"""Physical changes: from the request to the journal, the line, the configuration and the answer. One at a time.

The order of steps, each on the disk before the next begins: intent in the journal, write, verification, the fact in
`changes.yaml`, the journal closed, the answer. A change that the daemon did not live to finish is followed at the
next start until its sensor is found; its request is answered then.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from dataclasses import dataclass, field
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from lfs10d import adoption, assembly, findings, ratechange
from lfs10d.adoption import Adoption
from lfs10d.aside import aside
from lfs10d.changes import Place
from lfs10d.commands import Answer, Call, failed, rejected
from lfs10d.errors import StateError
from lfs10d.jobs.asking import Asking
from lfs10d.jobs.course import Course, Now, Over, Steps
from lfs10d.jobs.follow import follow
from lfs10d.jobs.readdress import NOTHING_WRITTEN, Ending, Verdict, Wish, Write, readdress
from lfs10d.journal import REMEMBERED_FOR_MS, Asked, Journal, Move, OpenChange, Spot, Told
from lfs10d.locating import Locating
from lfs10d.ratechange import RateChange
from lfs10d.reading import Errand
from lfs10d.requests.request import RefusedError

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping

    from lfs10d.adoption import Newcomer
    from lfs10d.changes import Changes, Saying
    from lfs10d.config import Config, SlaveConfig
    from lfs10d.effective import Effective
    from lfs10d.facts import Instant
    from lfs10d.jobs.job import Job
    from lfs10d.modbus.unanswered import Unanswered
    from lfs10d.profiles.schema import Profile
    from lfs10d.requests.request import Edit

log = logging.getLogger(__name__)
T = TypeVar("T")

KEPT_PAUSE = 30.0
"""After so many s a fact that could not be put on the disk is tried again."""


class Wire(Protocol):
    """What physical changes need of the line; see `lfs10d.line.Line`."""

    @property
    def unanswered(self) -> Unanswered:
        """Which requests may still be answered."""
        ...

    def echo_known(self) -> bool:
        """Whether it is known how the adapter echoes."""
        ...

    def submit(self, job: Job) -> None:
        """Have a job done; what it calls, it calls in the line's thread."""
        ...

    def go_on(self, course: Course, answer: object) -> None:
        """Tell a course what came of what it had done aside."""
        ...


class Recall(Protocol):
    """Remembers a request of an earlier life; see `lfs10d.service.Service.recall`."""

    def __call__(self, name: str, call: Call, answer: Answer | None, *, forget_in: float, tell: bool = False) -> None:
        """Remember it for `forget_in` s; with `tell` answer it too."""


class Talk:
    """One course as seen from the asyncio loop: what it wants done aside, in turn."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire
        self._loop = asyncio.get_running_loop()
        self._wanted: asyncio.Queue[object] = asyncio.Queue()
        self._course: Course | None = None

    def begin(self, steps: Steps, clock: Now, **sides: Any) -> None:  # noqa: ANN401 - the sides of a course
        """Have a course done on the line."""
        self._course = Course(steps, clock, self._aside, **sides)
        self.wire.submit(self._course)

    def _aside(self, _: Course, what: object) -> None:
        """Take over what is wanted, from the line's thread."""
        with contextlib.suppress(RuntimeError):  # the loop is closed: we are ending
            self._loop.call_soon_threadsafe(self._wanted.put_nowait, what)

    async def wanted(self) -> object:
        """Wait for what is wanted next, `Over` in the end."""
        return await self._wanted.get()

    def go_on(self, answer: object = None) -> None:
        """Answer what was wanted."""
        if self._course is not None:
            self.wire.go_on(self._course, answer)

    def halt(self) -> None:
        """Send no new frame."""
        if self._course is not None:
            self._course.halt()


@dataclass(slots=True)
class Underway:
    """The change that is being carried out: what is told as busy, and the slave ids it may bring into use."""

    request: str
    slaves: frozenset[int] = field(default_factory=frozenset)


class Physical:
    """Physical changes of one line. Used in the thread of the asyncio loop.

    `running()` is the configuration that holds, `change` puts another into force; `wire()` is the line. `tell`
    publishes an event, `act` what the line is busy with (None: as usual), `repoll` puts into force what is `polled`
    now; `recall` has a request of an earlier life of the daemon remembered, or answered.
    """

    def __init__(  # noqa: PLR0913 - all that it touches of the daemon, each by one callable
        self,
        journal: Journal,
        *,
        running: Callable[[], Effective],
        change: Callable[[Edit], Awaitable[object]],
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
        self.wire = wire
        self.tell = tell
        self._recall = recall
        self.now = now
        self.ending = False
        self._underway: Underway | None = None
        self._followed: dict[int, tuple[Talk, asyncio.Task[None]]] = {}
        self._writing: asyncio.Future[Any] | None = None
        self._act = act
        self._rates = RateChange(self)
        self._adoption = Adoption(self)
        self._locating = Locating(self, repoll)
        trouble = journal.take()
        if trouble is not None:
            log.error("%s", trouble)
        self._reserve()

    def recall(self) -> None:
        """Have the requests of earlier lives remembered for their repeats, and those that have no answer yet."""
        ts = self.now().ts()
        for told in self.journal.answers:
            self.respond(told, max(0.0, (told.at + REMEMBERED_FOR_MS - ts) / 1000), tell=False)
        for change in self.journal.open:
            if change.asked is not None and not change.answered:
                self._recall(change.asked.name, _call(change.asked), None, forget_in=inf)

    def respond(self, told: Told, forget_in: float = REMEMBERED_FOR_MS / 1000, *, tell: bool = True) -> None:
        """Answer a request of an earlier life, with `tell`, and its repeats."""
        error = dict(told.error or {})
        code, message = error.pop("code", None), error.pop("message", "")
        answer = Answer(told.status, told.data, code, message, error)
        self._recall(told.asked.name, _call(told.asked), answer, forget_in=forget_in, tell=tell)

    @property
    def underway(self) -> str | None:
        """The name of the request that is being carried out, None if there is none."""
        return None if self._underway is None else self._underway.request

    @property
    def open(self) -> tuple[OpenChange, ...]:
        """The changes whose sensors are still to be found."""
        return self.journal.open

    @property
    def busy(self) -> Answer | None:
        """The rejection of whatever must wait until a scan or a physical change is over, None if nothing must."""
        if self._underway is None:
            return None
        return rejected("busy", f"{self._underway.request} is being carried out; try again when it is over")

    @contextlib.contextmanager
    def place(self, request: str, slaves: frozenset[int] = frozenset()) -> Iterator[None]:
        """Hold the one place that scans and physical changes share; raises RefusedError where it is taken.

        `slaves` are the ids that it may bring into use.
        """
        if (busy := self.busy) is not None:
            raise RefusedError(busy)
        self._underway = Underway(request, slaves)
        self._reserve()
        try:
            yield
        finally:
            self._underway = None
            self._reserve()
            self.follow()

    def polled(self) -> Config:
        """Return the configuration for the line: without the devices that it must be asked for first."""
        config, withheld = self.running().polled, self._locating.withheld()
        slaves = tuple(slave for slave in config.slaves if slave.name not in withheld)
        return config.model_copy(update={"slaves": slaves})

    def reserved(self) -> Mapping[int, str]:
        """Return the slave ids that nobody may be given now, with the reason."""
        return self._reserved

    def _reserve(self) -> None:
        reserved: dict[int, str] = {}
        for change in self.journal.open:
            whose = ", ".join(sorted(change.devices))
            reserved |= dict.fromkeys(change.slaves, f"is reserved by the open change of {whose}")
        if self._underway is not None:
            reserved |= dict.fromkeys(self._underway.slaves, f"is about to be used by {self._underway.request}")
        self._reserved = reserved

    # -- the disk

    async def put(self, step: Callable[[], T]) -> T:
        """Have a step of the journal done aside, after the one before it; it is not cut short."""
        if self._writing is not None:
            await asyncio.wait([self._writing])
        self._writing = asyncio.ensure_future(aside(step, "journal"))
        try:
            return await asyncio.shield(self._writing)
        finally:
            self._reserve()

    def told(self, call: Asked | None, answer: Answer) -> Told | None:
        """Return an answer as the journal keeps it; None if nobody asked."""
        if call is None:
            return None
        return Told(asked=call, status=answer.status, data=answer.data, error=answer.error(), at=self.now().ts())

    def talk(self) -> Talk:
        """Return what a course on the line is talked with by."""
        return Talk(self.wire())

    # -- line/baudrate

    async def baudrate(self, to: int, *, power_cycle: bool, dry_run: bool, call: Call) -> Answer:
        """Move every sensor and the port to another rate, verified, or back."""
        if (busy := self.busy) is not None:
            return busy
        asked = asked_by(ratechange.NAME, call)
        with self.place(ratechange.NAME):
            self._act(ratechange.ACTIVITY)
            try:
                return await self._rates.perform(to, power_cycle=power_cycle, dry_run=dry_run, asked=asked)
            finally:
                self._act(None)

    # -- line/adopt

    async def adopt(self, wanted: Newcomer, call: Call) -> Answer:
        """Take in a factory-new sensor: a free id, the line's rate, and it is polled."""
        if (busy := self.busy) is not None:
            return busy
        asked = asked_by(adoption.NAME, call)
        with self.place(adoption.NAME, wanted.slaves):
            return await self._adoption.perform(wanted, asked)

    # -- device/readdress

    async def readdress(self, device: str, to: int, *, dry_run: bool, call: Call) -> Answer:
        """Give a sensor another slave id, verified; see `lfs10d.jobs.readdress`."""
        now = self.running()
        slave = now.slave(device)
        if slave is None:
            names = ", ".join(other.name for other in now.config.slaves) or "none"
            return rejected("unknown_device", f"there is no device {device}; configured are: {names}", param="device")
        refusal = self._unfit(device, slave, to, now)
        if refusal is not None:
            return refusal
        if (busy := self.busy) is not None:
            return busy
        asked = asked_by("device/readdress", call)
        with self.place("device/readdress", frozenset({slave.id, to})):
            return await self._readdress(slave, to, asked, dry_run=dry_run)

    def _unfit(self, device: str, slave: SlaveConfig, to: int, now: Effective) -> Answer | None:
        """Return why the line need not even be asked; None if it must be."""
        profile = now.loaded.profiles[slave.profile]
        first, last = profile.ids
        if profile.slave_id is None:
            return rejected("not_allowed", f"{device}: profile {profile.name} does not say how its slave id is set")
        if not first <= to <= last:
            return rejected("invalid_param", f"to: must be {first} to {last} for {profile.name}", param="to")
        if device in now.conflicts:
            return rejected("not_allowed", f"{device}: {now.conflicts[device]}")
        for other in now.config.slaves:
            if to in {other.id, *(place.id for place in now.places[other.name])}:
                return rejected("address_in_use", f"slave id {to} is that of {other.name}", param="to")
        own = frozenset().union(*(each.slaves for each in self.journal.open if device in each.devices))
        if to in self._reserved and to not in own:
            return rejected("address_in_use", f"slave id {to} {self._reserved[to]}", param="to")
        return None

    def asking(self, slave: SlaveConfig, clock: Now, line_rate: int | None = None) -> Asking:
        """Return how a device is asked; with a `line_rate` that no line has, its rate is told each time."""
        now = self.running()
        alone = now.config.model_copy(update={"slaves": (slave,)})
        (spec,) = assembly.device_specs(alone, now.loaded.profiles)
        rate = now.config.line.baudrate if line_rate is None else line_rate
        return Asking(spec.profile, spec.codec, self.wire().unanswered, clock, line_rate=rate)

    async def _readdress(self, slave: SlaveConfig, to: int, asked: Asked, *, dry_run: bool) -> Answer:
        now = self.running()
        profile, rate = now.loaded.profiles[slave.profile], now.config.line.baudrate
        rates = tuple(profile.baudrate.codes) if profile.baudrate else ()
        wish = Wish(Spot(slave=slave.id, baudrate=rate), to, rates, dry_run)
        await self.leave(self._changes_of(slave.name))
        clock = Now()
        talk = Talk(self.wire())
        steps = readdress(wish, self.asking(slave, clock), self.wire().echo_known)
        change: OpenChange | None = None
        try:
            talk.begin(steps, clock, line_rate=rate, excludes=frozenset({slave.id, to}))
            while not isinstance(what := await talk.wanted(), Over):
                if isinstance(what, Write):
                    why = None
                    try:
                        change = await self.put(partial(self._intend, slave.name, what, asked))
                    except StateError as error:
                        why = str(error)
                    talk.go_on(why)
            verdict = what.result or Verdict(Ending.LOST_BEFORE)
            return await self._conclude(slave.name, wish, verdict, change, asked, profile)
        except asyncio.CancelledError:
            talk.halt()
            return await self.cut_short(asked)
        finally:
            talk.go_on()

    def _intend(self, device: str, write: Write, asked: Asked) -> OpenChange:
        move = Move(device=device, old=write.old, new=write.new, register_before=write.register_before)
        return self.journal.intend("readdress", (move,), self.now().ts(), asked)

    async def _conclude(
        self, device: str, wish: Wish, verdict: Verdict, change: OpenChange | None, asked: Asked, profile: Profile
    ) -> Answer:
        """Put on the disk what came of it; return the answer."""
        answer = findings.readdressed(device, wish, verdict, profile)
        told = self.told(asked, answer)
        if change is None or verdict.ending in NOTHING_WRITTEN:
            with contextlib.suppress(StateError):  # nothing changed: a repeat may be judged anew
                await self.put(partial(self.journal.close, frozenset(), told))
            return answer
        try:
            if verdict.ending is Ending.MOVED:
                await self.record(device, wish.new)
                await self.put(partial(self.journal.close, self._changes_of(device), told))
                self._tell_moved(device, wish.old, wish.new)
            elif verdict.stays_open:
                if verdict.ending is Ending.PENDING:
                    await self.put(partial(self.journal.close, self._changes_of(device) - {change.number}, None))
                await self.put(partial(self.journal.keep, change.number, told))
            else:
                await self.put(partial(self.journal.close, frozenset({change.number}), told))
        except StateError as error:
            if verdict.ending is Ending.MOVED:
                message = f"{device} answers at slave id {wish.to} now, but that cannot be kept: {error}"
                return failed("storage_full", message, data=answer.data)
            log.warning("%s", error)
        if verdict.ending in (Ending.BOTH, Ending.GARBAGE):
            self.tell("duplicate_id", {"device": device, "slave": wish.to, "from": wish.old.slave})
        return answer

    def _changes_of(self, device: str) -> frozenset[int]:
        return frozenset(change.number for change in self.journal.open if device in change.devices)

    async def record(self, device: str, spot: Spot, newcomer: Saying | None = None) -> None:
        """Have the device polled where it was found, on the disk first; a `newcomer` is what is said of a new one."""

        def edit(now: Effective) -> Changes:
            if now.slave(device) is None:
                return now.changes if newcomer is None else now.changes.adding(device, newcomer, Place(spot.slave))
            return now.changes.moving(device, Place(spot.slave), now.said)

        await self.change(edit)

    def _tell_moved(self, device: str, old: Spot, new: Spot) -> None:
        log.info("%s answers at slave id %d now, not at %d any more", device, new.slave, old.slave)
        self.tell("readdressed", {"device": device, "from": old.slave, "to": new.slave})

    async def cut_short(self, asked: Asked) -> Answer:
        """Answer a request that the daemon's end cuts short; what it began is settled at the next start."""
        if self._writing is not None:
            await asyncio.wait([self._writing])
        mine = next((each for each in self.journal.open if each.asked == asked and not each.answered), None)
        if mine is None:
            return rejected("cancelled", "the daemon is ending; nothing was written")
        answer = failed("cancelled", "the daemon is ending; at its next start it looks where the sensor is")
        with contextlib.suppress(StateError):
            await self.put(partial(self.journal.keep, mine.number, self.told(asked, answer)))
        return answer

    # -- changes that are open

    def follow(self) -> None:
        """Look for the sensors of every open change that nobody looks for now."""
        if self.ending:
            return
        self._locating.begin()
        busy = frozenset() if self._underway is None else self._underway.slaves
        for change in self.journal.open:
            if change.number not in self._followed and not change.slaves & busy:
                talk = Talk(self.wire())
                task = asyncio.create_task(self._follow(change, talk), name=f"follow {change.number}")
                task.add_done_callback(partial(self._left, change.number))
                self._followed[change.number] = talk, task

    def _left(self, number: int, task: asyncio.Task[None]) -> None:
        if self._followed.get(number, (None, None))[1] is task:
            del self._followed[number]
        if not task.cancelled() and (mistake := task.exception()) is not None:
            log.error("an open change could not be followed, by a mistake of ours", exc_info=mistake)

    async def leave(self, changes: frozenset[int]) -> None:
        """Stop looking for the sensors of these changes: more is to be written to them."""
        for number in changes & set(self._followed):
            talk, task = self._followed.pop(number)
            talk.halt()
            talk.go_on()
            task.cancel()

    async def _follow(self, change: OpenChange, talk: Talk) -> None:
        try:
            await (self._rates.follow if change.kind == "baudrate" else self._follow_move)(change, talk)
        except StateError as error:
            log.warning("%s", error)
            await asyncio.sleep(KEPT_PAUSE)
            asyncio.get_running_loop().call_soon(self.follow)
        finally:
            talk.go_on()

    async def _follow_move(self, change: OpenChange, talk: Talk) -> None:
        (move,) = change.moves
        slave = self.running().slave(move.device) or adoption.newcomer(change, move)
        if slave is None:
            await self.drop(change, f"{move.device} is no longer configured")
            return
        now = self.running()
        clock = Now()
        here = Spot(slave=move.old.slave, baudrate=move.new.baudrate)
        steps = follow(
            here,
            move.new,
            self.asking(slave, clock, line_rate=0),
            longest_pause=now.config.poll.probe_interval_max,
            before=None if here == move.old else move.old,
        )
        talk.begin(steps, clock, line_rate=now.config.line.baudrate, share=1.0, errand=Errand.PROBE)
        while not isinstance(what := await talk.wanted(), Over):
            if isinstance(what, Verdict):
                change = await self._seen(change, move, what, now.loaded.profiles[slave.profile])
            talk.go_on()
        if what.result is not None:
            await self._found(change, move, what.result, now.loaded.profiles[slave.profile])

    async def _seen(self, change: OpenChange, move: Move, verdict: Verdict, profile: Profile) -> OpenChange:
        """Answer the request of a change that is not settled by the first look."""
        if verdict.ending in (Ending.BOTH, Ending.GARBAGE):
            self.tell("duplicate_id", {"device": move.device, "slave": move.new.slave, "from": move.old.slave})
        if change.answered:
            return change
        told = self.told(change.asked, findings.readdressed(move.device, _wish(move), verdict, profile))
        await self.put(partial(self.journal.keep, change.number, told))
        if told is not None:
            self.respond(told)
        return change.model_copy(update={"answered": True})

    async def _found(self, change: OpenChange, move: Move, verdict: Verdict, profile: Profile) -> None:
        """Finish a change whose sensor was found."""
        if verdict.ending is Ending.MOVED:
            answer = findings.readdressed(move.device, _wish(move), verdict, profile)
            await self.record(move.device, move.new, newcomer=adoption.entry(change))
            await self.close(self._changes_of(move.device), change, answer)
            self._tell_moved(move.device, move.old, move.new)
        else:
            why = f"{move.device} answers at slave id {move.old.slave}, and its register does not say {move.new.slave}"
            await self.drop(change, why)

    async def drop(self, change: OpenChange, why: str) -> None:
        """Undo a change that did not take effect."""
        message = f"{why}: the change is dropped"
        await self.close(frozenset({change.number}), change, failed("cancelled", f"the daemon ended; {message}"))
        log.warning("%s", message)
        for move in change.moves:
            facts = {"device": move.device, "from": move.old.slave, "to": move.new.slave}
            self.tell("change_dropped", {"key": f"slaves.{move.device}.id", **facts, "message": message})

    async def close(self, numbers: Iterable[int], change: OpenChange, answer: Answer) -> None:
        """Close changes; the request of `change` is answered if it is not yet."""
        told = None if change.answered else self.told(change.asked, answer)
        await self.put(partial(self.journal.close, frozenset(numbers), told))
        if told is not None:
            self.respond(told)

    # -- what else happens

    async def reconfigured(self, before: Config, after: Config) -> None:
        """Take note of another configuration: open changes of devices that are gone are closed."""
        devices = {slave.name for slave in before.slaves} - {slave.name for slave in after.slaves}
        for change in self.journal.open:
            if change.devices <= devices:
                await self.leave(frozenset({change.number}))
                with contextlib.suppress(StateError):
                    await self.drop(change, f"{', '.join(sorted(change.devices))} was removed")
        if not self.ending:
            self._locating.begin()

    async def stop(self) -> None:
        """Send no new frame of any change."""
        self.ending = True
        self._locating.stop()
        for talk, task in self._followed.values():
            talk.halt()
            task.cancel()
        if self._writing is not None:
            await asyncio.wait([self._writing])


def asked_by(name: str, call: Call) -> Asked:
    """Return a request as the journal keeps it."""
    return Asked(
        name=name,
        id=call.id,
        transaction=call.transaction,
        fingerprint=call.fingerprint,
        topic=call.topic,
        correlation=None if call.correlation is None else call.correlation.hex(),
    )


def _call(asked: Asked) -> Call:
    correlation = None if asked.correlation is None else bytes.fromhex(asked.correlation)
    return Call(asked.id, asked.transaction, fingerprint=asked.fingerprint, topic=asked.topic, correlation=correlation)


def _wish(move: Move) -> Wish:
    return Wish(move.old, move.new.slave, ())
