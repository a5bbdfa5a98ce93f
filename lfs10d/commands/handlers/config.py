"""`config/get`, `config/reload` and `config/reset`."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lfs10d.command import Command, Result, ok, rejected
from lfs10d.commands.context import Context
from lfs10d.commands.handlers.config_edit import altered, apply_edit, known_device, refuse
from lfs10d.commands.message import NoParameters, Parameters
from lfs10d.config import changes
from lfs10d.config.changes import Changes
from lfs10d.config.effective import Effective, effective
from lfs10d.errors import ConfigError
from lfs10d.schema.fields import Name, Text, quoted

LONGEST_KEY = 100
_KEY_OF_A_DEVICE = 3
"""Parts of `slaves.mast-top.interval`."""


class WhichChange(Parameters):
    """A device, or a key: `slaves.mast-top.interval`, or `interval` beside a device."""

    device: Annotated[str, Name()] | None = Field(None, description="All changes of this device.")
    key: Annotated[str, Text(LONGEST_KEY)] | None = Field(
        None, description="Or one: `slaves.mast-top.interval`, or `interval` beside a device."
    )

    @property
    def place(self) -> tuple[str, str | None]:
        """The device and its key, None for all keys; raises RefusedError for a change that no request made."""
        if not self.key:
            if not self.device:
                raise refuse("invalid_param", "device: is missing; give device or key", param="device")
            return self.device, None
        if self.key == "line.baudrate":
            raise refuse("invalid_param", "key: a baud rate cannot be reset; line/baudrate changes it", param="key")
        parts = self.key.split(".")
        if self.device and len(parts) == 1:
            return self.device, parts[0]
        if parts[0] == "slaves" and len(parts) in {2, _KEY_OF_A_DEVICE} and self.device in {None, parts[1]}:
            return parts[1], parts[2] if len(parts) == _KEY_OF_A_DEVICE else None
        raise refuse("invalid_param", f"key: no request changed {quoted(self.key)}", param="key")


async def get(_: NoParameters, context: Context, __: Command) -> Result:
    """Return the effective configuration without secrets, and the origin of each value that is no default."""
    loaded = context.config.loaded
    origins = {key: str(origin) for key, origin in loaded.origins.items() if origin.kind != "default"}
    return ok({"config": loaded.config.model_dump(mode="json"), "origins": origins})


async def reload(_: NoParameters, context: Context, __: Command) -> Result:
    """Read the files again and apply what changed; files with errors change nothing."""
    try:
        plan = await context.config.reload()
    except ConfigError as error:
        return rejected("invalid_param", str(error.problems[0]))
    return ok({"applied": list(plan.applied), "restart_required": list(plan.restart_required)})


async def reset(parameters: WhichChange, context: Context, command: Command) -> Result:
    """Undo changes made by request."""
    device, key = parameters.place
    before, now = await apply_edit(lambda now: _without(device, key, now), context)
    left = set(changes.keys(now.changes))
    data = {
        "dropped": [name for name in changes.keys(before.changes) if name not in left],
        "changed": altered(before, now),
    }
    context.publisher.applied("config/reset", command, device=device, **data)
    return ok(data)


def _without(device: str, key: str | None, now: Effective) -> Changes:
    """Return the changes without one; raises RefusedError if there is none, or it cannot be undone."""
    param = "device" if key is None else "key"
    change = now.changes.of(device)
    if not change:
        known_device(device, now)
        raise refuse("invalid_param", f"{param}: no request changed anything of {device}", param=param)
    if key is not None and key not in change.options:
        raise refuse("invalid_param", f"key: {_why_no_change(device, key, change)}", param="key")
    left = now.changes.resetting(device, None if key is None else frozenset({key}))
    if left == now.changes:
        raise refuse("invalid_param", f"device: {_fact(device)}", param="device")
    yielding = effective(now.file, left).conflicts.items() - now.conflicts.items()
    if yielding:
        name, why = min(yielding)
        raise refuse("address_in_use", f"{name} cannot be polled then: {why}")
    return left


def _why_no_change(device: str, key: str, change: changes.DeviceChange) -> str:
    if key == "id" and change.verified is not None:
        return _fact(device)
    if change.added is not None:
        return f"{device} was added by request as a whole; device/options changes it, device/remove removes it"
    return f"no request changed {quoted(key)} of {device}"


def _fact(device: str) -> str:
    return f"the slave id of {device} was verified on the line; device/readdress changes it"
