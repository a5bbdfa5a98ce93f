"""`health` and `republish`."""

from __future__ import annotations

from lfs10d.command import Command, Result, ok
from lfs10d.commands.context import Context
from lfs10d.commands.message import NoParameters


async def health(_: NoParameters, context: Context, __: Command) -> Result:
    """Return the state of the daemon, the line and every device."""
    return ok(context.publisher.health())


async def republish(_: NoParameters, context: Context, __: Command) -> Result:
    """Publish every retained topic again."""
    return ok({"topics": context.publisher.republish()})
