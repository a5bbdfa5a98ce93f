"""`device/readdress`, `line/baudrate` and `line/adopt`: what physically changes a sensor."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lfs10d.command import Command, Result
from lfs10d.commands.context import Context
from lfs10d.commands.handlers import device
from lfs10d.commands.message import Parameters
from lfs10d.commands.pause import FREED
from lfs10d.reconfiguration.adopt_request import AdoptRequest
from lfs10d.schema.fields import Choice, FilePath, Flag, Name, Text, Whole

DRY_RUN = "Only check whether it can be done; nothing is written."


class ReaddressParameters(Parameters):
    """The parameters of `device/readdress`."""

    device: device.DeviceName
    to: Annotated[int, Whole(1, 255)] = Field(description="Its new slave id.")
    dry_run: Annotated[bool, Flag()] = Field(default=False, description=DRY_RUN)


async def readdress(parameters: ReaddressParameters, context: Context, command: Command) -> Result:
    """Give a sensor another slave id, and verify it."""
    return await context.reconfiguration.readdress(
        parameters.device, parameters.to, dry_run=parameters.dry_run, call=command
    )


class BaudrateParameters(Parameters):
    """The parameters of `line/baudrate`."""

    to: Annotated[int, Choice((9600, 19200, 1200, 2400, 4800, 38400, 57600, 115200))] = Field(
        description="The new rate."
    )
    power_cycle: Annotated[bool, Flag()] = Field(
        default=False, description="The sensors use the new rate after their power is switched off and on."
    )
    dry_run: Annotated[bool, Flag()] = Field(default=False, description=DRY_RUN)


async def baudrate(parameters: BaudrateParameters, context: Context, command: Command) -> Result:
    """Move every sensor and the port to another rate, verified, or back."""
    if context.line.paused:
        return FREED
    return await context.reconfiguration.baudrate(
        parameters.to, power_cycle=parameters.power_cycle, dry_run=parameters.dry_run, call=command
    )


class AdoptParameters(Parameters):
    """The parameters of `line/adopt`."""

    name: Annotated[str, Name()] | None = Field(None, description="Without: `slave-5` for slave id 5.")
    label: Annotated[str | None, Text(200, null=True)] = Field(None, description="Text for people.")
    profile: Annotated[str, FilePath()] = Field("lfs10", description="Name or file of its profile.")
    factory: Annotated[int, Whole(1, 255)] | None = Field(
        default=None, alias="from", description="Without: the factory id of the profile."
    )
    to: Annotated[int, Whole(1, 255)] | None = Field(default=None, description="Without: the next free id from 2.")


async def adopt(parameters: AdoptParameters, context: Context, command: Command) -> Result:
    """Adopt a factory-new sensor: it gets a free slave id and the line's rate, and is polled."""
    wanted = parameters
    await device.profile_of(wanted.profile, context.config.now)
    request = AdoptRequest(wanted.name, wanted.label, wanted.factory, wanted.to, wanted.profile)
    return await context.reconfiguration.adopt(request, command)
