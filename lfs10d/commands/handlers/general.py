"""`health` and `republish`."""

from __future__ import annotations

from collections.abc import Mapping

from lfs10d.command import Answer, Call, ok
from lfs10d.commands.admission import Form
from lfs10d.commands.context import Powers, Request
from lfs10d.commands.message import NoParameters


async def health(_: NoParameters, powers: Powers, __: Call) -> Answer:
    """Tell how everything is."""
    return ok(powers.health())


async def republish(_: NoParameters, powers: Powers, __: Call) -> Answer:
    """Send every retained topic once more."""
    return ok({"topics": powers.republish()})


REQUESTS: Mapping[str, Request] = {
    "health": Request(Form("always"), health),
    "republish": Request(Form("always"), republish),
}
