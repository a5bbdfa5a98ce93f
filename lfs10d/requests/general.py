"""`health` and `republish`."""

from __future__ import annotations

from collections.abc import Mapping

from lfs10d.admission import Form
from lfs10d.commands import Answer, Call, NoParameters, ok
from lfs10d.requests.request import Powers, Request


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
