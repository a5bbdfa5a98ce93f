"""`device/readdress`: what physically changes a sensor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from lfs10d.admission import Form
from lfs10d.commands import Answer, Parameters
from lfs10d.kinds import Flag, Name, Whole
from lfs10d.requests.request import Powers, Request

if TYPE_CHECKING:
    from collections.abc import Mapping

    from lfs10d.commands import Call

REMEMBERED_FOR = 86_400.0
"""How long the answer to a physical change is kept for its repeats, in s."""


class Readdress(Parameters):
    """Which device gets which slave id; with `dry_run` nothing is written."""

    device: Annotated[str, Name()]
    to: Annotated[int, Whole(1, 255)]
    dry_run: Annotated[bool, Flag()] = False


async def readdress(parameters: Readdress, powers: Powers, call: Call) -> Answer:
    """Give a sensor another slave id."""
    return await powers.readdress(parameters.device, parameters.to, dry_run=parameters.dry_run, call=call)


REQUESTS: Mapping[str, Request] = {
    "device/readdress": Request(Form("sensors", Readdress, REMEMBERED_FOR), readdress),
}
