"""`line/trace`, `line/pause` and `line/cancel`."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lfs10d.command import Command, Result, ok
from lfs10d.commands.context import Context
from lfs10d.commands.message import NoParameters, Parameters
from lfs10d.schema.fields import Duration

LONGEST = 600.0
"""Longest time in s of a trace or a pause."""
USUAL = 30.0
"""Its usual time in s."""


class HowLong(Parameters):
    """The parameters of `line/trace` and `line/pause`."""

    duration: Annotated[float, Duration(0.1, LONGEST)] = Field(
        default=USUAL, alias="for", description="How long, from now on."
    )


async def trace(parameters: HowLong, context: Context, _: Command) -> Result:
    """Publish every frame on `trace` for some time."""
    context.line.trace(parameters.duration)
    return ok({"for": parameters.duration})


async def pause(parameters: HowLong, context: Context, _: Command) -> Result:
    """Free the port for another program for some time."""
    await context.line.pause(parameters.duration)
    return ok({"for": parameters.duration})


async def cancel(_: NoParameters, context: Context, __: Command) -> Result:
    """End the scan, trace and pause that are under way."""
    return ok({"cancelled": list(context.line.cancel())})
