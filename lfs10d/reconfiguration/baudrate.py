"""`line/baudrate` from the command to the journal, the line, the configuration and the result."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import replace
from functools import partial

from lfs10d.command import Result, failed, ok, rejected
from lfs10d.config.changes import Changes, Rate
from lfs10d.config.effective import Effective
from lfs10d.errors import StateError
from lfs10d.line.jobs.procedure import ProcedureClock
from lfs10d.reconfiguration import baudrate_answers
from lfs10d.reconfiguration.journal import BaudrateFacts, CommandRecord, Move, OpenBaudrate
from lfs10d.reconfiguration.procedures.baudrate import (
    UNTOUCHED,
    BaudrateEnding,
    BaudrateReport,
    RateSensor,
    RateWish,
    WriteRates,
    change_rate,
)
from lfs10d.reconfiguration.runner import ChangeRunner

log = logging.getLogger(__name__)

NAME = "line/baudrate"
ACTIVITY = "changing_baudrate"


def settled(runner: ChangeRunner, to: int) -> Result | None:
    """Return the result of a command that needs no exchange on the line; None if it needs some."""
    now = runner.running()
    old = now.config.line.baudrate
    if to != old:
        return _unfit(runner, to, now)
    return unsettled(runner) or ok({"from": old, "to": to, "pending": []})


async def perform(runner: ChangeRunner, to: int, *, power_cycle: bool, dry_run: bool, command: CommandRecord) -> Result:
    """Move every sensor and the port to another rate; see `lfs10d.reconfiguration.procedures.baudrate`.

    No open change is followed meanwhile.
    """
    now = runner.running()
    run = runner.new_run()
    sensors = rate_sensors(runner, [slave.name for slave in now.config.slaves], run.clock)
    wish = RateWish(sensors, now.config.line.baudrate, to, power_cycle, dry_run, _stored(runner, to))
    steps = change_rate(wish, runner.wire().echo_known)

    def intend(_: WriteRates) -> OpenBaudrate:
        moves = tuple(Move(device=each.name, old=each.at(wish.old), new=each.at(to)) for each in sensors)
        facts = BaudrateFacts(old=wish.old, to=to, power_cycle=power_cycle)
        change = OpenBaudrate(moves=moves, begun=runner.timestamp(), asked=command, facts=facts)
        return runner.journal.intend(change)

    async def conclude(report: BaudrateReport | None, change: OpenBaudrate | None) -> Result:
        """Record the outcome on disk; return the result."""
        report = report or BaudrateReport(BaudrateEnding.LOST_BEFORE)
        result = baudrate_answers.result(wish.old, to, report, dry_run=dry_run)
        if change is None or report.ended in UNTOUCHED:
            return await runner.refuse(command, result)
        for name in report.names if report.ended is BaudrateEnding.TWINS else ():
            announce_twins(runner, name, sensors)
        try:
            await _save(runner, report, change, result)
        except StateError as error:
            if report.ended is BaudrateEnding.MOVED:
                return failed("storage_full", f"all sensors are at {to} baud, but that cannot be saved: {error}")
            log.warning("%s", error)
        return result

    slaves = frozenset(sensor.slave for sensor in sensors)
    return await runner.perform(run, steps, command, intend, conclude, line_rate=0, excludes=slaves, share=1.0)


# -- open changes of the rate


def _stored(runner: ChangeRunner, to: int) -> frozenset[str]:
    """Return the devices that have stored a rate and need a power cycle."""
    waiting = (each.facts.pending or () for each in open_changes(runner) if each.facts.to == to)
    return frozenset().union(*waiting)


def open_changes(runner: ChangeRunner) -> list[OpenBaudrate]:
    """Return the open changes of the rate, the oldest first."""
    return [change for change in runner.open if change.kind == "baudrate"]


def unsettled(runner: ChangeRunner, device: str | None = None) -> Result | None:
    """Return the rejection of a command while the rate of a device, or of all, is unsettled."""
    for change in open_changes(runner):
        missing = sorted(change.devices) if change.facts.pending is None else change.facts.pending
        if missing and (device is None or device in missing):
            to, names = change.facts.to, ", ".join(missing)
            return rejected("busy", f"the change to {to} baud is not finished: {names} is not found there yet")
    return None


def _unfit(runner: ChangeRunner, to: int, now: Effective) -> Result | None:
    """Return why the command is rejected without an exchange on the line; None if it is not."""
    config, profiles = now.config, now.loaded.profiles
    able = [slave for slave in config.slaves if to in profiles[slave.profile].rate_codes]
    if not able and any(profiles[slave.profile].baudrate for slave in config.slaves):
        return rejected("invalid_param", f"to: no sensor of this line can be set to {to} baud", param="to")
    unable = ", ".join(slave.name for slave in config.slaves if slave not in able)
    if unable:
        return rejected("not_allowed", f"{unable} cannot be set to {to} baud: its profile has no code for that rate")
    if now.conflicts:
        return rejected("not_allowed", f"not every sensor can be queried: {next(iter(now.conflicts.values()))}")
    lost = [change for change in runner.open if change.kind != "baudrate" or not change.answered]
    if lost:
        names = ", ".join(sorted(lost[0].devices))
        return rejected("busy", f"{names} is not found yet after an earlier change; try again when it is")
    return None


# -- what came of it


def rate_sensors(runner: ChangeRunner, names: Iterable[str], clock: ProcedureClock) -> tuple[RateSensor, ...]:
    """Return the sensors of these names that are configured, each with its query."""
    slaves = (runner.running().slave(name) for name in names)
    return tuple(RateSensor(slave.name, slave.id, runner.query(slave, clock)) for slave in slaves if slave is not None)


async def _save(runner: ChangeRunner, report: BaudrateReport, change: OpenBaudrate, result: Result) -> None:
    """Record on disk where the sensors are, or that they are still to be found."""
    journal, journalled = runner.journal, runner.journalled
    record = runner.record(change.asked, result)
    earlier = frozenset(each.number for each in runner.open) - {change.number}
    pending = report.ended is BaudrateEnding.PENDING
    if report.ended is BaudrateEnding.MOVED or (pending and change.facts.to in report.where.values()):
        await save_rate(runner, change.facts.old, change.facts.to)
    if pending:
        await journalled(partial(journal.close, earlier, None))
        await journalled(partial(journal.set_pending, change.number, report.names))
    if pending or report.ended is BaudrateEnding.UNVERIFIED:
        await journalled(partial(journal.keep, change.number, record))
    else:
        await journalled(partial(journal.close, earlier | {change.number}, record))


def announce_twins(runner: ChangeRunner, device: str, sensors: Iterable[RateSensor]) -> None:
    """Announce that two sensors have the slave id of this one."""
    for slave in (sensor.slave for sensor in sensors if sensor.name == device):
        runner.announce_duplicate(device, slave, slave)


async def save_rate(runner: ChangeRunner, old: int, to: int) -> None:
    """Let the line use the rate at which its sensors were found; saved to disk first."""
    await runner.change(lambda now: at_rate(now.changes, to, now.file_values.baudrate))
    log.info("the line is at %d baud now", to)
    runner.announce("baudrate_changed", {"from": old, "to": to})


def at_rate(changes: Changes, rate: int, filed: int) -> Changes:
    """Return the changes with another rate of the line; `filed` is that of the file."""
    return replace(changes, baudrate=None if rate == filed else Rate(filed, rate))
