"""`config/get` and `config/reload`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lfs10d.admission import Form
from lfs10d.commands import Answer, NoParameters, ok, rejected
from lfs10d.errors import ConfigError
from lfs10d.requests.request import Powers, Request

if TYPE_CHECKING:
    from collections.abc import Mapping

    from lfs10d.commands import Call


async def get(_: NoParameters, powers: Powers, __: Call) -> Answer:
    """Tell the effective configuration."""
    return ok(powers.configuration())


async def reload(_: NoParameters, powers: Powers, __: Call) -> Answer:
    """Read the files again; a broken one changes nothing."""
    try:
        return ok(await powers.reload())
    except ConfigError as error:
        return rejected("invalid_param", str(error.problems[0]))


REQUESTS: Mapping[str, Request] = {
    "config/get": Request(Form("always"), get),
    "config/reload": Request(Form("polling"), reload),
}
