"""`health` and `republish`."""

from __future__ import annotations

from collections.abc import Mapping

from lfs10d.command import Command, Result, ok
from lfs10d.commands.admission import CommandSpec
from lfs10d.commands.context import Context, Handler
from lfs10d.commands.message import NoParameters


async def health(_: NoParameters, context: Context, __: Command) -> Result:
    """Return the state of the daemon, the line and every device."""
    return ok(context.publisher.health())


async def republish(_: NoParameters, context: Context, __: Command) -> Result:
    """Publish every retained topic again."""
    return ok({"topics": context.publisher.republish()})


HANDLERS: Mapping[str, Handler] = {
    "health": Handler(CommandSpec("always"), health),
    "republish": Handler(CommandSpec("always"), republish),
}
