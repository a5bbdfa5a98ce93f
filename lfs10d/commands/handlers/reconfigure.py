"""`device/readdress`, `line/baudrate` and `line/adopt`: what physically changes a sensor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from lfs10d.command import Command, RefusedError, Result
from lfs10d.commands.admission import CommandSpec
from lfs10d.commands.context import Context, Handler
from lfs10d.commands.handlers import device
from lfs10d.commands.message import Parameters
from lfs10d.schema.fields import Choice, FilePath, Flag, Name, Text, Whole

REMEMBERED_FOR = 86_400.0
"""How long the answer to a physical change is kept for its repeats, in s."""


class ReaddressParameters(Parameters):
    """Which device gets which slave id; with `dry_run` nothing is written."""

    device: Annotated[str, Name()]
    to: Annotated[int, Whole(1, 255)]
    dry_run: Annotated[bool, Flag()] = False


async def readdress(parameters: ReaddressParameters, powers: Context, call: Command) -> Result:
    """Give a sensor another slave id."""
    return await powers.readdress(parameters.device, parameters.to, dry_run=parameters.dry_run, call=call)


class BaudrateParameters(Parameters):
    """Which rate; with `power_cycle` the sensors obey when their power is switched off and on."""

    to: Annotated[int, Choice((9600, 19200, 1200, 2400, 4800, 38400, 57600, 115200))]
    power_cycle: Annotated[bool, Flag()] = False
    dry_run: Annotated[bool, Flag()] = False


async def baudrate(parameters: BaudrateParameters, powers: Context, call: Command) -> Result:
    """Move every sensor and the port to another rate."""
    return await powers.baudrate(
        parameters.to, power_cycle=parameters.power_cycle, dry_run=parameters.dry_run, call=call
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


async def adopt(parameters: AdoptParameters, powers: Context, call: Command) -> Result:
    """Take in a factory-new sensor."""
    wanted = parameters
    try:
        await device.profile_of(wanted.profile, powers.effective())
    except RefusedError as error:
        return error.answer
    return await powers.adopt(
        name=wanted.name,
        label=wanted.label,
        profile=wanted.profile,
        factory=wanted.factory,
        to=wanted.to,
        call=call,
    )


REQUESTS: Mapping[str, Handler] = {
    "device/readdress": Handler(CommandSpec("sensors", ReaddressParameters, REMEMBERED_FOR), readdress),
    "line/adopt": Handler(CommandSpec("sensors", AdoptParameters, REMEMBERED_FOR), adopt),
    "line/baudrate": Handler(CommandSpec("sensors", BaudrateParameters, REMEMBERED_FOR), baudrate),
}
