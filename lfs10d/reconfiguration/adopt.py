"""`line/adopt` from the command to the journal, the line, the configuration and the result."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from functools import partial
from typing import Any

from lfs10d.command import Result, failed, ok, rejected
from lfs10d.config.effective import Effective
from lfs10d.config.models import LineConfig, SlaveConfig, default_device_name
from lfs10d.errors import StateError
from lfs10d.line.settings import DEFAULT_PROFILE
from lfs10d.profiles.profile import Profile
from lfs10d.reconfiguration.adopt_request import AdoptRequest
from lfs10d.reconfiguration.journal import (
    AdoptFacts,
    CommandRecord,
    Endpoint,
    Move,
    OpenAdopt,
    OpenChange,
)
from lfs10d.reconfiguration.procedures import adopt
from lfs10d.reconfiguration.procedures.readdress import NOTHING_WRITTEN, IdWrite, ReaddressEnding, ReaddressReport
from lfs10d.reconfiguration.readdress_answers import unsuccessful
from lfs10d.reconfiguration.runner import ChangeRunner

log = logging.getLogger(__name__)

NAME = "line/adopt"
FIRST_ID = 2
"""The first id that is given; 1 is the factory id and stays free for the next new sensor."""
LAST_ID = 247
"""The last id that is given: those above are reserved (Modbus over Serial Line V1.02, section 2.2)."""
CANDIDATES = 8
"""Number of free ids that are tried; if all turn out to be in use, the command is rejected."""

_TEXTS: Mapping[ReaddressEnding, str] = {
    ReaddressEnding.TAKEN: "slave id {to} is in use by a device that is not configured; see line/scan",
    ReaddressEnding.ABSENT: "nothing answers at slave id {old}{refusal}; is the new sensor connected and powered?",
    ReaddressEnding.DEAF: (
        "it is not known yet whether the adapter echoes what is sent; try again, or set line.echo to on or off"
    ),
    ReaddressEnding.LOST_BEFORE: "the port was lost; nothing was written",
    ReaddressEnding.UNWRITTEN: "{why}; nothing was written",
    ReaddressEnding.UNRECOGNISED: (
        "the device at slave id {old}, at {at} baud, is not recognised as {title}: {why}. Nothing was written. "
        "If it is another kind of sensor, give its profile; else take it off the line"
    ),
    ReaddressEnding.TWINS: "two sensors seem to have slave id {old}: {why}; nothing was written. Connect one at a time",
    ReaddressEnding.BOTH: "more than one sensor answers at slave id {old}; connect one at a time",
    ReaddressEnding.GARBAGE: (
        "since the write several sensors answer at once at slave id {to}; take the other one off the line"
    ),
    ReaddressEnding.REFUSED: "the sensor at {old} refused the write{refusal}; perhaps its {lock} overrules it",
    ReaddressEnding.LOCKED: (
        "the sensor stays at slave id {old}: its {lock} overrules the write; set that to 0 and try again. "
        "Or it needs its power switched off and on first"
    ),
    ReaddressEnding.PENDING: (
        "the sensor stored what was written but is still at slave id {old}: switch its power off and on, and ask "
        "again if it does not appear. If that does not help, its {lock} overrules the write"
    ),
    ReaddressEnding.NOWHERE: (
        "since the write the sensor answers neither at slave id {old} nor at {to}; both are queried until it is found"
    ),
}


async def perform(runner: ChangeRunner, request: AdoptRequest, command: CommandRecord) -> Result:
    """Adopt a factory-new sensor; see `lfs10d.reconfiguration.procedures.adopt`."""
    profile = await runner.profile(request.profile)
    now = runner.running()
    wish = _wish(runner, request, profile, now)
    if isinstance(wish, Result):
        return await runner.refuse(command, wish)
    slave = SlaveConfig(id=wish.factory, profile=request.profile)
    run = runner.new_run()
    query = runner.query(slave, run.clock, profile)
    steps = adopt.adopt(wish, query, runner.wire().echo_known)

    def intend(write: IdWrite) -> OpenAdopt:
        name = request.name or default_device_name(write.new.slave)
        move = Move(device=name, old=write.old, new=write.new, register_before=write.register_before)
        facts = AdoptFacts(label=request.label, profile=request.profile)
        return runner.journal.intend(OpenAdopt(moves=(move,), begun=runner.timestamp(), asked=command, facts=facts))

    async def conclude(report: adopt.AdoptReport | None, change: OpenAdopt | None) -> Result:
        """Record the outcome on disk; return the result."""
        report = report or adopt.AdoptReport(ReaddressReport(ReaddressEnding.LOST_BEFORE))
        ending, to = report.readdress.ending, report.to or 0
        name = request.name or default_device_name(to)
        result = _result(name, wish.factory, to, report.readdress, profile, written=change is not None)
        if ending is ReaddressEnding.TWINS:
            rate = report.old.baudrate if report.old else None
            runner.announce("duplicate_id", {"slave": wish.factory, "baudrate": rate})
        if change is None or ending in NOTHING_WRITTEN:
            return await runner.refuse(command, result)
        try:
            await _save(runner, report, change, result)
        except StateError as error:
            if ending is ReaddressEnding.MOVED:
                return failed("storage_full", f"the sensor is at slave id {to} now, but that cannot be saved: {error}")
            log.warning("%s", error)
            return result
        if ending is ReaddressEnding.MOVED:
            facts = {"request": NAME, "id": command.key, "device": name, "from": None, "to": {"slave": to}}
            runner.announce("change_applied", facts)
        return result

    ids = frozenset({wish.factory, *wish.candidates})
    rate = now.config.line.baudrate
    return await runner.perform(run, steps, command, intend, conclude, line_rate=rate, excludes=ids)


def _wish(runner: ChangeRunner, request: AdoptRequest, profile: Profile, now: Effective) -> adopt.AdoptWish | Result:
    """Return the adoption to carry out on the line, or the rejection if it cannot be."""
    line_rate = now.config.line.baudrate
    if profile.factory is None or (unfit := _unfit(profile, now.config.line)) is not None:
        why = f"profile {profile.name} has no factory settings" if profile.factory is None else unfit
        return rejected("not_allowed", f"{profile.title}: {why}", param="profile")
    factory = request.factory or profile.factory.id
    names = {slave.name for slave in now.config.slaves}
    taken = _taken(runner, request.slaves | {factory}, now)
    if (refusal := _refusal(request, factory, taken, names, now)) is not None:
        return refusal
    candidates = _candidates(request, factory, taken, names, profile)
    if not candidates and request.to is not None:
        message = f"name: the default {default_device_name(request.to)} is taken; give it another name"
        return rejected("invalid_param", message, param="name")
    rates = tuple(dict.fromkeys((line_rate, profile.factory.baudrate, *profile.rate_codes)))
    return adopt.AdoptWish(factory, candidates, line_rate, rates)


def _taken(runner: ChangeRunner, own: frozenset[int], now: Effective) -> dict[int, str]:
    """Return the slave ids that a new sensor cannot have, with the reason; `own` are those of its own command."""
    taken = {slave.id: f"is that of {slave.name}" for slave in now.config.slaves}
    for slave in now.config.slaves:
        taken |= {place.id: f"is that of {slave.name}" for place in now.places[slave.name]}
    reserved = runner.reservations.reserved
    taken |= {slave_id: why for slave_id, why in reserved.items() if slave_id not in own}
    for change in runner.open:
        taken |= dict.fromkeys(change.slaves, "is reserved by an open change")
    return taken


async def _save(runner: ChangeRunner, report: adopt.AdoptReport, change: OpenAdopt, result: Result) -> None:
    """Record on disk where the sensor is, or that it is still to be found."""
    readdress, record = report.readdress, runner.record(change.asked, result)
    journal, journalled = runner.journal, runner.journalled
    if readdress.ending is ReaddressEnding.MOVED:
        (move,) = change.moves
        await runner.save_endpoint(move.device, move.new, added=entry(change))
    elif readdress.stays_open:
        if readdress.ending is not ReaddressEnding.NOWHERE and report.at_rate:
            await journalled(partial(journal.amend, change.number, (_at_rate(change),)))
        await journalled(partial(journal.keep, change.number, record))
        return
    await journalled(partial(journal.close, frozenset({change.number}), record))


def _refusal(
    request: AdoptRequest, factory: int, taken: Mapping[int, str], names: AbstractSet[str], now: Effective
) -> Result | None:
    """Return why a request is rejected without an exchange on the line; None if it is not."""
    if factory in taken:
        message = f"slave id {factory} {taken[factory]}; keep the factory's id free for new sensors"
        return rejected("address_in_use", message, param="from")
    if request.to is not None and (request.to in taken or request.to == factory):
        why = taken.get(request.to, "is where the new sensor is")
        return rejected("address_in_use", f"slave id {request.to} {why}", param="to")
    if request.name is not None and (request.name in names or now.changes.of(request.name).added is not None):
        return rejected("invalid_param", f"name: {request.name} is taken; give it another name", param="name")
    return None


def _candidates(
    request: AdoptRequest, factory: int, taken: Mapping[int, str], names: AbstractSet[str], profile: Profile
) -> tuple[int, ...]:
    """Return the slave ids to try, in order; none whose default name is taken where the request gives no name."""
    ids = range(FIRST_ID, min(LAST_ID, profile.ids[1]) + 1) if request.to is None else (request.to,)
    free = [slave_id for slave_id in ids if slave_id not in taken and slave_id != factory]
    named = [slave_id for slave_id in free if request.name or default_device_name(slave_id) not in names]
    return tuple(named[:CANDIDATES])


def _at_rate(change: OpenAdopt) -> Move:
    """Return the new sensor's place once it has the line's rate: at its old place there may be another one."""
    (move,) = change.moves
    return move.model_copy(update={"old": Endpoint(slave=move.old.slave, baudrate=move.new.baudrate)})


def entry(change: OpenChange) -> dict[str, Any] | None:
    """Return the configuration's entry for the new sensor of an open change; None if it has none."""
    if change.kind != "adopt":
        return None
    values: dict[str, Any] = {"id": change.moves[0].new.slave}
    if change.facts.label is not None:
        values["label"] = change.facts.label
    if change.facts.profile not in (None, DEFAULT_PROFILE):
        values["profile"] = change.facts.profile
    return values


def new_slave(change: OpenChange) -> SlaveConfig | None:
    """Return the new sensor of an open change as it would be configured; None if it has none."""
    if change.kind != "adopt":
        return None
    (move,) = change.moves
    return SlaveConfig(id=move.new.slave, name=move.device, profile=change.facts.profile or DEFAULT_PROFILE)


def _unfit(profile: Profile, line: LineConfig) -> str | None:
    """Return why no new sensor of a profile can be adopted on a line; None if one can."""
    if profile.slave_id is None:
        return f"profile {profile.name} does not define how its slave id is set"
    if line.framing not in profile.framings:
        return f"it does not support {line.framing}"
    at_factory = profile.factory is not None and profile.factory.baudrate == line.baudrate
    if not at_factory and line.baudrate not in profile.rate_codes:
        return f"it cannot be set to the {line.baudrate} baud of this line"
    return None


def _result(name: str, old: int, to: int, report: ReaddressReport, profile: Profile, *, written: bool) -> Result:
    """Return the result of `line/adopt`; `written`: something was written to the sensor."""
    if report.ending is ReaddressEnding.MOVED:
        return ok({"device": name, "slave": to, "from": old})
    words = {"old": old, "to": to, "title": profile.title}
    data = {"device": name, "from": old, "to": to} if written else None
    return unsuccessful(report, _TEXTS, words, profile, data=data)
