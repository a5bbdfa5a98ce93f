"""`device/readdress` from the command to the journal, the line, the configuration and the result."""

from __future__ import annotations

import logging
from functools import partial

from lfs10d.command import Result, failed, rejected
from lfs10d.config.effective import Effective
from lfs10d.config.models import SlaveConfig
from lfs10d.errors import StateError
from lfs10d.reconfiguration import readdress_answers
from lfs10d.reconfiguration.journal import CommandRecord, Endpoint, Move, OpenReaddress
from lfs10d.reconfiguration.procedures.readdress import (
    NOTHING_WRITTEN,
    IdWrite,
    ReaddressEnding,
    ReaddressReport,
    ReaddressWish,
    readdress,
)
from lfs10d.reconfiguration.runner import ChangeRunner

log = logging.getLogger(__name__)

NAME = "device/readdress"


def fit(runner: ChangeRunner, device: str, to: int) -> SlaveConfig | Result:
    """Return the device that may get this id, or the rejection that needs no exchange on the line."""
    now = runner.running()
    slave = now.slave(device)
    if slave is None:
        names = ", ".join(other.name for other in now.config.slaves) or "none"
        return rejected("unknown_device", f"there is no device {device}; configured are: {names}", param="device")
    profile = now.loaded.profiles[slave.profile]
    first, last = profile.ids
    if profile.slave_id is None:
        return rejected("not_allowed", f"{device}: profile {profile.name} does not define how its slave id is set")
    if not first <= to <= last:
        return rejected("invalid_param", f"to: must be {first} to {last} for {profile.name}", param="to")
    if device in now.conflicts:
        return rejected("not_allowed", f"{device}: {now.conflicts[device]}")
    return _taken(runner, device, to, now) or slave


def _taken(runner: ChangeRunner, device: str, to: int, now: Effective) -> Result | None:
    for other in now.config.slaves:
        if to in {other.id, *(place.id for place in now.places[other.name])}:
            return rejected("address_in_use", f"slave id {to} is that of {other.name}", param="to")
    reserved = runner.reservations.reserved
    mine = runner.id_changes_of(device)
    own = frozenset().union(*(each.slaves for each in runner.open if each.number in mine))
    if to in reserved and to not in own:
        return rejected("address_in_use", f"slave id {to} {reserved[to]}", param="to")
    return None


async def perform(
    runner: ChangeRunner, slave: SlaveConfig, to: int, command: CommandRecord, *, dry_run: bool
) -> Result:
    """Give a sensor another slave id, verified; see `lfs10d.reconfiguration.procedures.readdress`.

    No open change of its id is followed meanwhile.
    """
    now = runner.running()
    profile, rate = now.loaded.profiles[slave.profile], now.config.line.baudrate
    wish = ReaddressWish(Endpoint(slave=slave.id, baudrate=rate), to, tuple(profile.rate_codes), dry_run)
    run = runner.new_run()
    steps = readdress(wish, runner.query(slave, run.clock), runner.wire().echo_known)

    def intend(write: IdWrite) -> OpenReaddress:
        move = Move(device=slave.name, old=write.old, new=write.new, register_before=write.register_before)
        return runner.journal.intend(OpenReaddress(moves=(move,), begun=runner.timestamp(), asked=command))

    async def conclude(report: ReaddressReport | None, change: OpenReaddress | None) -> Result:
        """Record the outcome on disk; return the result."""
        report = report or ReaddressReport(ReaddressEnding.LOST_BEFORE)
        result = readdress_answers.result(slave.name, wish, report, profile)
        if report.ending is ReaddressEnding.TWINS:
            runner.announce_duplicate(slave.name, slave.id, slave.id)
        if change is None or report.ending in NOTHING_WRITTEN:
            return await runner.refuse(command, result)
        try:
            await _save(runner, report, change, result)
        except StateError as error:
            if report.ending is ReaddressEnding.MOVED:
                message = f"{slave.name} answers at slave id {to} now, but that cannot be saved: {error}"
                return failed("storage_full", message, data=result.data)
            log.warning("%s", error)
        if report.ending in (ReaddressEnding.BOTH, ReaddressEnding.GARBAGE):
            runner.announce_duplicate(slave.name, to, slave.id)
        return result

    slaves = frozenset({slave.id, to})
    return await runner.perform(run, steps, command, intend, conclude, line_rate=rate, excludes=slaves)


async def _save(runner: ChangeRunner, report: ReaddressReport, change: OpenReaddress, result: Result) -> None:
    """Record on disk where the sensor is, or that it is still to be found."""
    (move,), record = change.moves, runner.record(change.asked, result)
    if report.ending is ReaddressEnding.MOVED:
        await runner.save_endpoint(move.device, move.new)
        await runner.close(runner.id_changes_of(move.device), change, record)
        runner.announce_readdressed(move.device, move.old.slave, move.new.slave)
    elif report.stays_open:
        if report.ending is ReaddressEnding.PENDING:
            await runner.close(runner.id_changes_of(move.device) - {change.number}, change, None)
        await runner.journalled(partial(runner.journal.keep, change.number, record))
    else:
        await runner.journalled(partial(runner.journal.close, frozenset({change.number}), record))
