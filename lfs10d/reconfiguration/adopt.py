"""`line/adopt` from the request to the journal, the line, the configuration and the answer."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from lfs10d.command import ErrorCode, Result, failed, ok, rejected
from lfs10d.config.effective import Effective
from lfs10d.config.models import LineConfig, SlaveConfig, default_device_name
from lfs10d.errors import StateError
from lfs10d.line.jobs.procedure import ProcedureClock
from lfs10d.line.settings import DEFAULT_PROFILE
from lfs10d.profiles.profile import Profile
from lfs10d.reconfiguration.journal import CommandRecord, Endpoint, Move, OpenChange
from lfs10d.reconfiguration.procedures import adopt
from lfs10d.reconfiguration.procedures.readdress import NOTHING_WRITTEN, IdWrite, ReaddressEnding, ReaddressReport

if TYPE_CHECKING:
    from lfs10d.reconfiguration.reconfiguration import Reconfiguration

log = logging.getLogger(__name__)

NAME = "line/adopt"
FIRST_ID = 2
"""The first id that is given; 1 is the factory's, and is kept free for the next newcomer."""
LAST_ID = 247
"""The last id that is given: those above are reserved (Modbus over Serial Line V1.02, section 2.2)."""
CANDIDATES = 8
"""So many ids are looked at before it is told that somebody who is not configured has them all."""

_WORDS: Mapping[ReaddressEnding, tuple[ErrorCode, str]] = {
    ReaddressEnding.TAKEN: (
        "address_in_use",
        "somebody is heard at slave id {to}, who is not configured; see line/scan",
    ),
    ReaddressEnding.ABSENT: (
        "timeout",
        "nobody answers at slave id {old}{refusal}; is the new sensor connected and powered?",
    ),
    ReaddressEnding.DEAF: (
        "line_error",
        "whether the adapter returns our own bytes is not clear yet; try again, or set line.echo to on or off",
    ),
    ReaddressEnding.LOST_BEFORE: ("line_error", "the port was lost; nothing was written"),
    ReaddressEnding.UNWRITTEN: ("storage_full", "{why}; nothing was written"),
    ReaddressEnding.UNRECOGNISED: (
        "not_recognised",
        (
            "at slave id {old}, at {at} baud, a device answers that is not recognised as {title}: {why}. Nothing was "
            "written. If it is another kind of sensor, name its profile; else take it off the line"
        ),
    ),
    ReaddressEnding.TWINS: (
        "duplicate_id",
        "two sensors seem to have slave id {old}: {why}; nothing was written. Connect one at a time",
    ),
    ReaddressEnding.BOTH: ("duplicate_id", "more than one sensor is heard at slave id {old}; connect one at a time"),
    ReaddressEnding.GARBAGE: (
        "duplicate_id",
        "at slave id {to} several answer at once since the write; take the other off",
    ),
    ReaddressEnding.REFUSED: (
        "refused",
        "the sensor at {old} refused the write{refusal}; perhaps its {lock} overrules it",
    ),
    ReaddressEnding.LOCKED: (
        "dip_switch",
        (
            "the sensor stays at slave id {old}: its {lock} overrules the write; set that to 0 and try again. "
            "Or it wants its power switched off and on before it obeys"
        ),
    ),
    ReaddressEnding.PENDING: (
        "power_cycle_needed",
        (
            "the sensor took what was written but is still at slave id {old}: switch its power off and on, and ask "
            "again if it does not appear. If that does not help, its {lock} overrules the write"
        ),
    ),
    ReaddressEnding.NOWHERE: (
        "not_verified",
        "since the write the sensor answers neither at slave id {old} nor at {to}; it is looked for until it is found",
    ),
}


@dataclass(frozen=True, slots=True)
class AdoptRequest:
    """What a request wants: the sensor at `factory` (None: as the profile says) at id `to` (None: the next free).

    `profile` is the configuration's word for its profile.
    """

    name: str | None = None
    label: str | None = None
    factory: int | None = None
    to: int | None = None
    profile: str = DEFAULT_PROFILE

    @property
    def slaves(self) -> frozenset[int]:
        """The ids that are known to be used by it."""
        return frozenset(slave for slave in (self.factory, self.to) if slave is not None)


class Adopt:
    """Newcomers; a part of `Reconfiguration`."""

    def __init__(self, physical: Reconfiguration) -> None:
        self._physical = physical

    async def perform(self, wanted: AdoptRequest, asked: CommandRecord) -> Result:
        """Take in a factory-new sensor; see `lfs10d.reconfiguration.procedures.adopt`."""
        physical = self._physical
        profile = await physical.profile(wanted.profile)
        now = physical.running()
        wish = self._wish(wanted, profile, now)
        if isinstance(wish, Result):
            return await physical.refused(asked, wish)
        slave = SlaveConfig(id=wish.factory, profile=wanted.profile)
        clock = ProcedureClock()
        talk = physical.talk()
        asking = physical.asking(slave, clock, line_rate=0, profile=profile)
        steps = adopt.adopt(wish, asking, physical.wire().echo_known)
        ids = frozenset({wish.factory, *wish.candidates})
        talk.begin(steps, clock, line_rate=now.config.line.baudrate, excludes=ids)

        async def conclude(result: Any, change: OpenChange | None) -> Result:  # noqa: ANN401 - a course's
            found = result or adopt.AdoptReport(ReaddressReport(ReaddressEnding.LOST_BEFORE))
            return await self._conclude(wanted, wish, profile, found, change, asked)

        return await physical.carried_out(talk, asked, lambda write: self._intend(wanted, write, asked), conclude)

    def _wish(self, wanted: AdoptRequest, profile: Profile, now: Effective) -> adopt.AdoptWish | Result:
        """Return what the line is asked, or why it need not be."""
        line_rate = now.config.line.baudrate
        if profile.factory is None or (unfit := _unfit(profile, now.config.line)) is not None:
            why = f"profile {profile.name} does not say how a new one comes" if profile.factory is None else unfit
            return rejected("not_allowed", f"{profile.title}: {why}", param="profile")
        factory = wanted.factory or profile.factory.id
        taken = {slave.id: f"is that of {slave.name}" for slave in now.config.slaves}
        for slave in now.config.slaves:
            taken |= {place.id: f"is that of {slave.name}" for place in now.places[slave.name]}
        taken |= {
            slave: why for slave, why in self._physical.reserved().items() if slave not in wanted.slaves | {factory}
        }
        for change in self._physical.open:
            taken |= dict.fromkeys(change.slaves, "is reserved by an open change")
        names = {slave.name for slave in now.config.slaves}
        if factory in taken:
            message = f"slave id {factory} {taken[factory]}; keep the factory's id free for newcomers"
            return rejected("address_in_use", message, param="from")
        if wanted.to is not None and (wanted.to in taken or wanted.to == factory):
            why = taken.get(wanted.to, "is where the newcomer is")
            return rejected("address_in_use", f"slave id {wanted.to} {why}", param="to")
        if wanted.name is not None and (wanted.name in names or now.changes.of(wanted.name).added is not None):
            return rejected("invalid_param", f"name: {wanted.name} is taken; give it another name", param="name")
        ids = range(FIRST_ID, min(LAST_ID, profile.ids[1]) + 1) if wanted.to is None else (wanted.to,)
        free = [slave for slave in ids if slave not in taken and slave != factory]
        candidates = [slave for slave in free if wanted.name or default_device_name(slave) not in names][:CANDIDATES]
        if not candidates and wanted.to is not None:
            message = f"name: the default {default_device_name(wanted.to)} is taken; give it another name"
            return rejected("invalid_param", message, param="name")
        codes = profile.baudrate.codes if profile.baudrate else ()
        rates = tuple(dict.fromkeys((line_rate, profile.factory.baudrate, *codes)))
        return adopt.AdoptWish(factory, tuple(candidates), line_rate, rates)

    def _intend(self, wanted: AdoptRequest, write: IdWrite, asked: CommandRecord) -> OpenChange:
        name = wanted.name or default_device_name(write.new.slave)
        move = Move(device=name, old=write.old, new=write.new, register_before=write.register_before)
        moment = self._physical.now().ts()
        facts = {"label": wanted.label, "profile": wanted.profile}
        return self._physical.journal.intend("adopt", (move,), moment, asked, **facts)

    async def _conclude(
        self,
        wanted: AdoptRequest,
        wish: adopt.AdoptWish,
        profile: Profile,
        found: adopt.AdoptReport,
        change: OpenChange | None,
        asked: CommandRecord,
    ) -> Result:
        physical, verdict = self._physical, found.verdict
        old, to = wish.factory, found.to or 0
        name = wanted.name or default_device_name(to)
        answer = _answer(name, old, to, verdict, profile, written=change is not None)
        if verdict.ending is ReaddressEnding.TWINS:
            physical.tell("duplicate_id", {"slave": old, "baudrate": found.old.baudrate if found.old else None})
        if change is None or verdict.ending in NOTHING_WRITTEN:
            return await physical.refused(asked, answer)
        told = physical.told(asked, answer)
        numbers = frozenset({change.number})
        try:
            if verdict.ending is ReaddressEnding.MOVED:
                (move,) = change.moves
                await physical.record(name, move.new, newcomer=entry(change))
                await physical.put(partial(physical.journal.close, numbers, told))
                facts = {"request": NAME, "id": asked.key, "device": name, "from": None, "to": {"slave": to}}
                physical.tell("change_applied", facts)
            elif verdict.stays_open:
                if verdict.ending is not ReaddressEnding.NOWHERE and found.at_rate:
                    await physical.put(partial(physical.journal.amend, change.number, (_at_rate(change),)))
                await physical.put(partial(physical.journal.keep, change.number, told))
            else:
                await physical.put(partial(physical.journal.close, numbers, told))
        except StateError as error:
            if verdict.ending is ReaddressEnding.MOVED:
                return failed("storage_full", f"the sensor is at slave id {to} now, but that cannot be kept: {error}")
            log.warning("%s", error)
        return answer


def _at_rate(change: OpenChange) -> Move:
    """Return where the newcomer is since it speaks at the line's rate: where it was before another one may be now."""
    (move,) = change.moves
    return move.model_copy(update={"old": Endpoint(slave=move.old.slave, baudrate=move.new.baudrate)})


def entry(change: OpenChange) -> dict[str, Any] | None:
    """Return what is said of the newcomer of an open change; None if it has none."""
    if change.kind != "adopt":
        return None
    label = change.facts.get("label")
    said: dict[str, Any] = {"id": change.moves[0].new.slave}
    if label is not None:
        said["label"] = label
    if _word(change) != DEFAULT_PROFILE:
        said["profile"] = _word(change)
    return said


def _word(change: OpenChange) -> str:
    """Return the configuration's word for the profile of a newcomer; an older journal has no such word."""
    return str(change.facts.get("profile", DEFAULT_PROFILE))


def newcomer(change: OpenChange, move: Move) -> SlaveConfig | None:
    """Return the newcomer of an open change as it would be configured; None if it has none."""
    if change.kind != "adopt":
        return None
    return SlaveConfig(id=move.new.slave, name=move.device, profile=_word(change))


def _unfit(profile: Profile, line: LineConfig) -> str | None:
    """Return why no newcomer of a profile can be adopted on a line; None if one can."""
    if profile.slave_id is None:
        return f"profile {profile.name} does not say how its slave id is set"
    if line.framing not in profile.framings:
        return f"it does not speak {line.framing}"
    at_factory = profile.factory is not None and profile.factory.baudrate == line.baudrate
    if not at_factory and (profile.baudrate is None or line.baudrate not in profile.baudrate.codes):
        return f"it cannot be set to the {line.baudrate} baud of this line"
    return None


def _answer(name: str, old: int, to: int, verdict: ReaddressReport, profile: Profile, *, written: bool) -> Result:
    if verdict.ending is ReaddressEnding.MOVED:
        return ok({"device": name, "slave": to, "from": old})
    code, text = _WORDS[verdict.ending]
    refusal = "" if verdict.exception is None else f" (exception {verdict.exception:02X})"
    lock = (profile.slave_id and profile.slave_id.locked_by) or "address switch"
    title = profile.title
    message = text.format(old=old, to=to, at=verdict.at, why=verdict.why, refusal=refusal, lock=lock, title=title)
    facts: dict[str, Any] = {} if verdict.exception is None else {"exception_code": verdict.exception}
    if not written:
        return rejected(code, message, param=None, **facts)
    return failed(code, message, data={"device": name, "from": old, "to": to}, **facts)
