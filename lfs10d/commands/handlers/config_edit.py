"""Edits of the configuration by request: saved and applied, or refused."""

from __future__ import annotations

from typing import Any

from lfs10d.command import ErrorCode, RefusedError, rejected
from lfs10d.commands.context import Context
from lfs10d.config.diff import difference
from lfs10d.config.effective import Edit, Effective
from lfs10d.config.models import SlaveConfig
from lfs10d.errors import StateError


async def apply_edit(edit: Edit, context: Context) -> tuple[Effective, Effective]:
    """Change the configuration; raises RefusedError, also if the change cannot be saved."""
    try:
        return await context.config.change(edit)
    except StateError as error:
        raise RefusedError(rejected("storage_full", f"{error}; nothing was changed")) from None


def refuse(code: ErrorCode, message: str, *, param: str | None = None, **facts: object) -> RefusedError:
    """Return the error that refuses a request; nothing was changed."""
    return RefusedError(rejected(code, message, param=param, **facts))


def known_device(device: str, now: Effective) -> SlaveConfig:
    """Return a configured device; raises RefusedError if there is none of this name."""
    slave = now.slave(device)
    if slave is None:
        names = ", ".join(each.name for each in now.config.slaves) or "none"
        raise refuse("unknown_device", f"there is no device {device}; configured are: {names}", param="device")
    return slave


def as_json(slave: SlaveConfig, keys: tuple[str, ...]) -> dict[str, Any]:
    """Return the settings of a device for JSON: durations in s, a learned time-out is `auto`."""
    values = {key: getattr(slave, key) for key in keys}
    if "response_timeout" in values and values["response_timeout"] is None:
        values["response_timeout"] = "auto"
    return values


def altered(before: Effective, now: Effective) -> list[dict[str, Any]]:
    """Return the differences between two configurations: key, from, to; an added or removed device is one."""
    found = difference(before.config, now.config)
    changed = [{"key": change.key, "from": change.old, "to": change.new} for change in found.changed]
    for names, old, new in ((found.added, None, "polled"), (found.removed, "polled", None)):
        changed += [{"key": f"slaves.{name}", "from": old, "to": new} for name in names]
    return changed
