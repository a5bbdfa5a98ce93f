"""`device/readdress`, `line/baudrate` and `line/adopt`: what physically changes a sensor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from lfs10d.command import Command, Result
from lfs10d.commands.admission import CommandSpec
from lfs10d.commands.context import Context, Handler
from lfs10d.commands.handlers import device
from lfs10d.commands.message import Parameters
from lfs10d.commands.pause import FREED
from lfs10d.reconfiguration.adopt_request import AdoptRequest
from lfs10d.schema.fields import Choice, FilePath, Flag, Name, Text, Whole

REMEMBERED_FOR = 86_400.0
"""How long the answer to a physical change is kept for its repeats, in s."""


class ReaddressParameters(Parameters):
    """Which device gets which slave id; with `dry_run` nothing is written."""

    device: Annotated[str, Name()]
    to: Annotated[int, Whole(1, 255)]
    dry_run: Annotated[bool, Flag()] = False


async def readdress(parameters: ReaddressParameters, context: Context, command: Command) -> Result:
    """Give a sensor another slave id."""
    return await context.reconfiguration.readdress(
        parameters.device, parameters.to, dry_run=parameters.dry_run, call=command
    )


class BaudrateParameters(Parameters):
    """Which rate; with `power_cycle` the sensors obey when their power is switched off and on."""

    to: Annotated[int, Choice((9600, 19200, 1200, 2400, 4800, 38400, 57600, 115200))]
    power_cycle: Annotated[bool, Flag()] = False
    dry_run: Annotated[bool, Flag()] = False


async def baudrate(parameters: BaudrateParameters, context: Context, command: Command) -> Result:
    """Move every sensor and the port to another rate."""
    if context.line.paused:
        return FREED
    return await context.reconfiguration.baudrate(
        parameters.to, power_cycle=parameters.power_cycle, dry_run=parameters.dry_run, call=command
    )


class AdoptParameters(Parameters):
    """What the new sensor is to be called, what it is, where it is and which slave id it is to get."""

    name: Annotated[str, Name()] | None = None
    label: Annotated[str | None, Text(200, null=True)] = None
    profile: Annotated[str, FilePath()] = "lfs10"
    factory: Annotated[int, Whole(1, 255)] | None = Field(
        default=None, alias="from", description="Without: the factory id of the profile."
    )
    to: Annotated[int, Whole(1, 255)] | None = Field(default=None, description="Without: the next free id from 2.")


async def adopt(parameters: AdoptParameters, context: Context, command: Command) -> Result:
    """Take in a factory-new sensor."""
    wanted = parameters
    await device.profile_of(wanted.profile, context.config.now)
    request = AdoptRequest(wanted.name, wanted.label, wanted.factory, wanted.to, wanted.profile)
    return await context.reconfiguration.adopt(request, command)


HANDLERS: Mapping[str, Handler] = {
    "device/readdress": Handler(CommandSpec("sensors", ReaddressParameters, REMEMBERED_FOR), readdress),
    "line/adopt": Handler(CommandSpec("sensors", AdoptParameters, REMEMBERED_FOR), adopt),
    "line/baudrate": Handler(CommandSpec("sensors", BaudrateParameters, REMEMBERED_FOR), baudrate),
}
