"""`line/baudrate` from the request to the journal, the line, the configuration and the answer."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Any

from lfs10d.command import ErrorCode, Result, failed, ok, rejected
from lfs10d.config.changes import Changes, Rate
from lfs10d.config.effective import Effective
from lfs10d.errors import StateError
from lfs10d.line.jobs.procedure import Finished, ProcedureClock
from lfs10d.reading import Purpose
from lfs10d.reconfiguration.journal import CommandRecord, Move, OpenChange
from lfs10d.reconfiguration.procedure_run import ProcedureRun
from lfs10d.reconfiguration.procedures.baudrate import (
    FIRST_PAUSE,
    ROLL_BACK,
    UNTOUCHED,
    BaudrateEnding,
    BaudrateReport,
    RateSensor,
    RateWish,
    WriteRates,
    change_rate,
)
from lfs10d.reconfiguration.procedures.recover_baudrate import (
    CameUp,
    Twins,
    await_lost,
    await_power,
    look_back,
    put_back,
)

if TYPE_CHECKING:
    from lfs10d.reconfiguration.reconfiguration import Reconfiguration

log = logging.getLogger(__name__)

NAME = "line/baudrate"
ACTIVITY = "changing_baudrate"

_WORDS: Mapping[BaudrateEnding, tuple[ErrorCode, str]] = {
    BaudrateEnding.ABSENT: (
        "timeout",
        "nothing was written, for {names} does not answer; every sensor must, or would be lost",
    ),
    BaudrateEnding.DEAF: (
        "line_error",
        (
            "whether the adapter returns our own bytes is not clear yet, and nothing was written; "
            "try again later, or set line.echo to on or off"
        ),
    ),
    BaudrateEnding.LOST_BEFORE: ("line_error", "the port was lost; nothing was written"),
    BaudrateEnding.UNWRITTEN: ("storage_full", "{why}; nothing was written"),
    BaudrateEnding.REFUSED: ("refused", "{names} refused the write{refusal}; everything is as it was, at {old} baud"),
    BaudrateEnding.CANARY: (
        "power_cycle_needed",
        (
            "{names} took the rate but still answers at {old} baud, so the write was taken back and no other sensor "
            "was touched. Ask again with power_cycle true, then switch the power of all off and on. Or its setting is "
            "locked by a switch"
        ),
    ),
    BaudrateEnding.TWINS: (
        "duplicate_id",
        (
            "since the write {names} answers at {old} and at {to} baud: two sensors have its slave id; take one of "
            "them off the line. All are at {old} again"
        ),
    ),
    BaudrateEnding.ROLLED_BACK: ("rolled_back", "not every sensor followed to {to} baud; all are at {old} again"),
    BaudrateEnding.UNVERIFIED: (
        "not_verified",
        "{names} is not found again; it was at {old} baud last, and is asked at {old} and {to} until it is",
    ),
}


class BaudrateChange:
    """Changes of the line's rate; a part of `Reconfiguration`."""

    def __init__(self, physical: Reconfiguration) -> None:
        self._physical = physical

    async def perform(self, to: int, *, power_cycle: bool, dry_run: bool, asked: CommandRecord) -> Result:
        """Move every sensor and the port to another rate; see `lfs10d.reconfiguration.procedures.baudrate`."""
        physical = self._physical
        now = physical.running()
        old = now.config.line.baudrate
        if to == old and (unsettled := self.unsettled()) is not None:
            return await physical.refused(asked, unsettled)
        if to == old:
            return await physical.refused(asked, ok({"from": old, "to": to, "pending": []}))
        refusal = self._unfit(to, now)
        if refusal is not None:
            return await physical.refused(asked, refusal)
        earlier = frozenset(change.number for change in physical.journal.open)
        physical.leave(earlier)
        clock = ProcedureClock()
        sensors = self._sensors([slave.name for slave in now.config.slaves], clock)
        wish = RateWish(sensors, old, to, power_cycle, dry_run, self._stored(to))
        talk = physical.talk()
        steps = change_rate(wish, physical.wire().echo_known)
        talk.begin(steps, clock, line_rate=0, excludes=frozenset(sensor.slave for sensor in sensors), share=1.0)

        def intend(_: WriteRates) -> OpenChange:
            return self._intend(wish, asked)

        async def conclude(result: Any, change: OpenChange | None) -> Result:  # noqa: ANN401 - a course's
            return await self._conclude(
                wish, result or BaudrateReport(BaudrateEnding.LOST_BEFORE), change, earlier, asked
            )

        return await physical.carried_out(talk, asked, intend, conclude)

    def _stored(self, to: int) -> frozenset[str]:
        """Return the devices that have stored a rate and wait for their power cycle."""
        waiting = (each.facts.get("pending", ()) for each in self._changes() if each.facts["to"] == to)
        return frozenset().union(*waiting)

    def _changes(self) -> list[OpenChange]:
        return [change for change in self._physical.open if change.kind == "baudrate"]

    def newest(self) -> int:
        """Return the number of the newest open change of the rate, 0 if there is none: older ones end with it."""
        return max((change.number for change in self._changes()), default=0)

    def unsettled(self, device: str | None = None) -> Result | None:
        """Return the rejection of what must wait until the rate of a device, or of all, is settled."""
        for change in self._changes():
            missing = change.facts.get("pending", sorted(change.devices))
            if missing and (device is None or device in missing):
                to, names = change.facts["to"], ", ".join(missing)
                return rejected("busy", f"the change to {to} baud is not over: {names} is still to be found there")
        return None

    def _unfit(self, to: int, now: Effective) -> Result | None:
        """Return why the line need not even be asked; None if it must be."""
        config, profiles = now.config, now.loaded.profiles
        able = [slave for slave in config.slaves if to in _rates(profiles[slave.profile].baudrate)]
        if not able and any(profiles[slave.profile].baudrate for slave in config.slaves):
            return rejected("invalid_param", f"to: no sensor of this line can speak at {to} baud", param="to")
        unable = [slave.name for slave in config.slaves if slave not in able]
        if unable:
            return rejected(
                "not_allowed", f"{', '.join(unable)} could not follow to {to} baud: its profile has no such"
            )
        if now.conflicts:
            return rejected("not_allowed", f"not every sensor can be asked: {next(iter(now.conflicts.values()))}")
        lost = [change for change in self._physical.journal.open if change.kind != "baudrate" or not change.answered]
        if lost:
            names = ", ".join(sorted(lost[0].devices))
            return rejected("busy", f"{names} is being looked for after an earlier change; it must be found first")
        return None

    def _sensors(self, names: Iterable[str], clock: ProcedureClock) -> tuple[RateSensor, ...]:
        """Return the sensors of these names that are configured, each as it is asked."""
        slaves = (self._physical.running().slave(name) for name in names)
        return tuple(
            RateSensor(slave.name, slave.id, self._physical.asking(slave, clock, line_rate=0))
            for slave in slaves
            if slave is not None
        )

    def _intend(self, wish: RateWish, asked: CommandRecord) -> OpenChange:
        moves = tuple(
            Move(device=sensor.name, old=sensor.at(wish.old), new=sensor.at(wish.to)) for sensor in wish.sensors
        )
        facts: dict[str, Any] = {"from": wish.old, "to": wish.to, "power_cycle": wish.power_cycle}
        return self._physical.journal.intend("baudrate", moves, self._physical.now().ts(), asked, **facts)

    async def _conclude(
        self,
        wish: RateWish,
        verdict: BaudrateReport,
        change: OpenChange | None,
        earlier: frozenset[int],
        asked: CommandRecord,
    ) -> Result:
        physical = self._physical
        answer = _answer(wish.old, wish.to, verdict, dry_run=wish.dry_run)
        if change is None or verdict.ended in UNTOUCHED:
            return await physical.refused(asked, answer)
        told = physical.told(asked, answer)
        for name in verdict.names if verdict.ended is BaudrateEnding.TWINS else ():
            self._tell_twins(name, wish.sensors)
        try:
            if verdict.ended is BaudrateEnding.MOVED or (
                wish.to in verdict.where.values() and verdict.ended is BaudrateEnding.PENDING
            ):
                await self._record(wish.old, wish.to)
            if verdict.ended is BaudrateEnding.PENDING:
                await physical.put(partial(physical.journal.close, earlier, None))
                await physical.put(partial(physical.journal.amend, change.number, change.moves, pending=verdict.names))
                await physical.put(partial(physical.journal.keep, change.number, told))
            elif verdict.ended is BaudrateEnding.UNVERIFIED:
                await physical.put(partial(physical.journal.keep, change.number, told))
            else:
                await physical.put(partial(physical.journal.close, earlier | {change.number}, told))
        except StateError as error:
            if verdict.ended is BaudrateEnding.MOVED:
                return failed("storage_full", f"all sensors are at {wish.to} baud, but that cannot be kept: {error}")
            log.warning("%s", error)
        return answer

    def _tell_twins(self, device: str, sensors: Iterable[RateSensor]) -> None:
        """Tell that two sensors have one slave id."""
        for slave in (sensor.slave for sensor in sensors if sensor.name == device):
            self._physical.tell("duplicate_id", {"device": device, "slave": slave, "from": slave})

    async def _record(self, old: int, to: int) -> None:
        """Have the line speak at the rate its sensors were found at, on the disk first."""

        def edit(now: Effective) -> Changes:
            filed = now.said.baudrate
            return replace(now.changes, baudrate=None if to == filed else Rate(filed, to))

        await self._physical.change(edit)
        log.info("the line is at %d baud now", to)
        self._physical.tell("baudrate_changed", {"from": old, "to": to})

    # -- changes that are open

    async def follow(self, change: OpenChange, talk: ProcedureRun) -> None:
        """Look for the sensors of an open change; finish it, or undo what the daemon did not live to finish."""
        old, to = int(change.facts["from"]), int(change.facts["to"])
        if change.answered and "pending" in change.facts:
            await self._await_power(change, talk, old, to)
        else:
            await self._undo(change, talk, old, to)

    async def _await_power(self, change: OpenChange, talk: ProcedureRun, old: int, to: int) -> None:
        """Follow sensors that have stored the new rate until each comes up there."""
        physical = self._physical
        clock = ProcedureClock()
        pending = list(change.facts["pending"])
        sensors = self._sensors(pending, clock)
        steps = await_power(sensors, old, to, longest_pause=physical.running().config.poll.probe_interval_max)
        talk.begin(steps, clock, line_rate=0, share=1.0, errand=Purpose.PROBE)
        while not isinstance(what := await talk.wanted(), Finished):
            if isinstance(what, CameUp):
                if physical.running().config.line.baudrate != to:
                    await self._record(old, to)
                pending.remove(what.name)
                await physical.put(partial(physical.journal.amend, change.number, change.moves, pending=pending))
            elif isinstance(what, Twins):
                self._tell_twins(what.name, sensors)
            talk.go_on()
        if what.result is not None:
            await self._settle(change, old, to, what.result)

    async def _undo(self, change: OpenChange, talk: ProcedureRun, old: int, to: int) -> None:
        """Put back at once what answers, and what is lost when it is found, within the share of probes."""
        physical = self._physical
        longest = physical.running().config.poll.probe_interval_max
        clock = ProcedureClock()
        everybody = found = self._sensors([move.device for move in change.moves], clock)
        where: dict[str, int | None] = {}
        twins: set[str] = set()
        finish, tell_at, pause = not change.answered, inf, min(FIRST_PAUSE, longest)
        while True:
            own = physical.running().config.line.baudrate
            steps = look_back(found, old, to, where, own=own)
            talk.begin(steps, clock, line_rate=0, share=1.0, excludes=frozenset(each.slave for each in found))
            if await self._over(talk, found, twins) is None:
                return
            if finish and all(at == to for at in where.values()):
                await self._settle(change, old, to, BaudrateReport(BaudrateEnding.MOVED, where))
                return
            tell_at = clock.now + ROLL_BACK if finish else tell_at
            away = tuple(sensor for sensor in found if where[sensor.name] != old)
            here = tuple(sensor for sensor in found if where[sensor.name] == old)
            talk.go_on()
            talk.begin(
                put_back(away, old, to, where),
                clock, line_rate=0, share=1.0, excludes=frozenset(sensor.slave for sensor in away),
            )  # fmt: skip
            if await self._over(talk, found, twins) is None:
                return
            talk.go_on()
            talk.begin(put_back(here, old, to, where), clock, line_rate=0)  # of two of one id one may have moved
            verdict = await self._over(talk, found, twins)
            if verdict is None:
                return
            if verdict.ended is not BaudrateEnding.UNVERIFIED:
                await self._settle(change, old, to, verdict)
                return
            if old in where.values() and own != old:
                await self._record(to, old)  # those that are back are polled, whoever is still lost
            talk.go_on()
            finish = False
            lost = tuple(sensor for sensor in everybody if where[sensor.name] != old)
            talk.begin(
                await_lost(
                    lost, old, to, where, own=physical.running().config.line.baudrate,
                    pause=pause, longest_pause=longest, tell_at=inf if change.answered else tell_at,
                ),
                clock, line_rate=0, share=1.0, errand=Purpose.PROBE,
            )  # fmt: skip
            while not isinstance(what := await talk.wanted(), Finished):
                change = await physical.answered(change, _answer(old, to, verdict))
                talk.go_on()
            if what.result is None:
                return
            talk.go_on()
            found, pause = what.result, min(2 * pause, longest)

    async def _over(self, talk: ProcedureRun, sensors: Iterable[RateSensor], twins: set[str]) -> Any:  # noqa: ANN401 - a course's
        """Return the result of a course, None where the port was lost; tell of `twins` that were not told of yet."""
        while not isinstance(what := await talk.wanted(), Finished):
            if isinstance(what, Twins) and what.name not in twins:
                twins.add(what.name)
                self._tell_twins(what.name, sensors)
            talk.go_on()
        return what.result

    async def _settle(self, change: OpenChange, old: int, to: int, verdict: BaudrateReport) -> None:
        physical = self._physical
        if verdict.ended is BaudrateEnding.MOVED:
            if physical.running().config.line.baudrate != to:
                await self._record(old, to)
        elif physical.running().config.line.baudrate != old:
            await self._record(to, old)
        older = frozenset(each.number for each in self._changes() if each.number <= change.number)
        await physical.finish(older, change, _answer(old, to, verdict))
        if verdict.ended is not BaudrateEnding.MOVED:
            message = f"every sensor is at {old} baud: the change to {to} is dropped"
            log.warning("%s", message)
            physical.tell("change_dropped", {"key": "line.baudrate", "from": old, "to": to, "message": message})


def _rates(register: Any) -> Iterable[int]:  # noqa: ANN401 - a profile's, or None
    return () if register is None else register.codes


def _answer(old: int, to: int, verdict: BaudrateReport, *, dry_run: bool = False) -> Result:
    if verdict.ended in (BaudrateEnding.MOVED, BaudrateEnding.PENDING):
        return ok({"from": old, "to": to, "pending": list(verdict.names)})
    if verdict.ended is BaudrateEnding.FREE:
        return ok({"from": old, "to": to, "dry_run": dry_run})
    code, text = _WORDS[verdict.ended]
    refusal = "" if verdict.exception is None else f" (exception {verdict.exception:02X})"
    message = text.format(names=", ".join(verdict.names), old=old, to=to, why=verdict.why, refusal=refusal)
    if verdict.ended in UNTOUCHED:
        return rejected(code, message)
    facts = {} if verdict.exception is None else {"exception_code": verdict.exception}
    return failed(code, message, data={"where": dict(verdict.where)}, **facts)
