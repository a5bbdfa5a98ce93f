"""`line/scan`: finds the devices on the line while polling goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from lfs10d.command import Command, RefusedError, Result, failed, ok
from lfs10d.commands.context import Context
from lfs10d.commands.handlers import device
from lfs10d.commands.message import Parameters
from lfs10d.line.jobs.scan_ids import LAST_ID, ids_of
from lfs10d.schema.fields import Choice, FieldKind, Flag, Whole
from lfs10d.schema.quantities import BAUDRATES
from lfs10d.system.dataclass import dataclass

if TYPE_CHECKING:  # as in `lfs10d.commands.context`
    from lfs10d.line.jobs.identification import FoundDevice
    from lfs10d.line.jobs.scan import Scan

RATES = Choice(BAUDRATES)


@dataclass(frozen=True)
class SlaveIds(FieldKind):
    """Slave ids, as text of ids and ranges or as a list."""

    words = f'ids and ranges from 1 to {LAST_ID} such as "1-20,30", or a list such as [1, 2, 3]'

    def accept(self, value: object) -> tuple[int, ...]:
        """Take either way; return the ids in order, each once."""
        if isinstance(value, str):
            try:
                return ids_of(value)
            except ValueError:
                raise self.refusal(value) from None
        one = Whole(1, LAST_ID)
        if not isinstance(value, list) or not value:
            raise self.refusal(value)
        return tuple(sorted({one.accept(each) for each in value}))


@dataclass(frozen=True)
class ScanRates(FieldKind):
    """Rates of a line, as a list."""

    words = f"a list such as [9600, 19200] of the rates {RATES.words}; or null"

    def accept(self, value: object) -> tuple[int, ...] | None:
        """Take a list; return its rates in their order, each once."""
        if value is None:
            return None
        if not isinstance(value, list) or not value:
            raise self.refusal(value)
        return tuple(dict.fromkeys(int(RATES.accept(each) or 0) for each in value))


class WhomToFind(Parameters):
    """The parameters of `line/scan`."""

    ids: Annotated[tuple[int, ...], SlaveIds()] = Field(
        default=f"1-{LAST_ID}", validate_default=True, description="Slave ids to ask."
    )
    baudrates: Annotated[tuple[int, ...] | None, ScanRates()] = Field(
        default=None, description="Without: the line's own, and both of an LFS10."
    )
    share: Annotated[int, Whole(1, 100)] = Field(
        default=30, description="Most of the line's time that it takes, in percent; polling keeps 5 in any case."
    )
    add: Annotated[bool, Flag()] = Field(
        default=False,
        description="Add, as by `device/add`, each device that is new, recognised, at the line's rate and not suspect.",
    )


async def scan(parameters: WhomToFind, context: Context, command: Command) -> Result:
    """Find the devices on the line, while polling goes on."""
    done = await context.line.scan(parameters.ids, parameters.baudrates or (), parameters.share / 100)
    data: dict[str, Any] = {"found": [_told(finding, context) for finding in done.found]}
    asked = f"after {done.progress.asked} of {done.progress.total} ids"
    if done.lost:
        return failed("line_error", f"the port was lost {asked}", data=data)
    if not done.complete:
        return failed("cancelled", f"the scan was ended {asked}", data=data)
    if parameters.add:
        data |= await _add(done, context, command)
    return ok(data)


def _known(finding: FoundDevice, context: Context) -> str | None:
    """Return the name of the device that is configured at this slave id and rate."""
    config = context.config.now.config
    if finding.baudrate != config.line.baudrate:
        return None
    return next((slave.name for slave in config.slaves if slave.id == finding.slave), None)


def _told(finding: FoundDevice, context: Context) -> dict[str, Any]:
    name = _known(finding, context)
    return {
        "id": finding.slave,
        "baudrate": finding.baudrate,
        "known": name is not None,
        "suspect": finding.suspect,
        "duplicate": finding.duplicate,
        "device": name,
        "profile": None if finding.profile is None else finding.profile.name,
        "alternatives": [profile.name for profile in finding.alternatives],
        "rtt_ms": None if finding.rtt is None else round(finding.rtt * 1e3, 1),
    }


async def _add(done: Scan, context: Context, command: Command) -> dict[str, list[dict[str, Any]]]:
    """Add the new devices that are recognised beyond doubt, as `device/add` does; return those added and not added."""
    added: list[dict[str, Any]] = []
    refused: list[dict[str, Any]] = []
    for finding in done.found:
        now = context.config.now
        profile = finding.profile
        doubtful = finding.suspect or finding.duplicate or finding.baudrate != now.config.line.baudrate
        doubtful = doubtful or bool(finding.alternatives)  # as another profile its values would be wrong
        if profile is None or doubtful or _known(finding, context) is not None:
            continue
        own = now.loaded.profiles
        word = next((word for word, known in own.items() if known.name == profile.name), profile.name)
        wanted = device.NewDevice(slave=finding.slave, profile=word)
        try:
            answer = await device.add(wanted, context, command)
        except RefusedError as error:
            answer = error.result
        entry = {"id": finding.slave, "error": answer.error()} if answer.code else answer.data
        (refused if answer.code else added).append(entry)  # type: ignore[arg-type]  # device/add answers with an object
    return {"added": added, "not_added": refused}
