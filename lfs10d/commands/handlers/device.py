"""`device/add`, `device/remove`, `device/options` and `device/read`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from pydantic import Field

from lfs10d.command import Command, ErrorCode, Result, failed, ok
from lfs10d.commands.context import Context
from lfs10d.commands.handlers.config_edit import apply_edit, as_json, known_device, refuse
from lfs10d.commands.message import Parameters
from lfs10d.config.changes import OPTIONS, Changes, Place
from lfs10d.config.defaults import inherited
from lfs10d.config.effective import Effective, effective
from lfs10d.config.models import Interval, Label, ResponseTimeout, SlaveConfig, SlaveId, default_device_name
from lfs10d.config.validation import contradictions
from lfs10d.errors import ConfigError
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import FaultCode
from lfs10d.schema.fields import FilePath, Flag, Name, quoted
from lfs10d.system.threads import run_in_thread

SHOWN = ("label", "profile", "interval", "enabled", "response_timeout")
"""Keys of the response about a device that was added."""
STATED = ("label", "profile", "interval")
"""Keys of a device that `device/add` may give; the others have their defaults."""


DeviceName: TypeAlias = Annotated[str, Name(), Field(description="Name of the device.")]


class OneDevice(Parameters):
    """The parameters of a request about one device."""

    device: DeviceName


class NewDevice(Parameters):
    """The parameters of `device/add`."""

    slave: SlaveId = Field(description="Its slave id, 1 to 255.")
    name: Annotated[str, Name()] | None = Field(None, description="Without: `slave-5` for slave id 5.")
    label: Label = Field(None, description="Text for people.")
    profile: Annotated[str, FilePath()] = Field("lfs10", description="Name or file of its profile.")
    interval: Interval | None = Field(None, description="Without: `poll.interval` of the configuration.")
    probe: Annotated[bool, Flag()] = Field(default=True, description="Add it only if it answers now.")

    @property
    def device(self) -> str:
        """Its name, or the default name."""
        return self.name or default_device_name(self.slave)

    @property
    def entry(self) -> dict[str, Any]:
        """Its entry in the configuration."""
        stated = {key: getattr(self, key) for key in STATED if key in self.model_fields_set}
        return {"id": self.slave, **{key: value for key, value in stated.items() if value is not None}}


class Options(Parameters):
    """The parameters of `device/options`; those that are absent stay as they are."""

    device: DeviceName
    interval: Interval = Field(1.0, description="Time between two polls.")
    enabled: Annotated[bool, Flag()] = Field(default=True, description="Whether it is polled.")
    label: Label = Field(None, description="Text for people.")
    response_timeout: ResponseTimeout = Field(None, description="How long an answer may take to begin.")

    @property
    def wanted(self) -> dict[str, Any]:
        """The options that were given."""
        return {key: getattr(self, key) for key in OPTIONS if key in self.model_fields_set}


async def add(parameters: NewDevice, context: Context, command: Command) -> Result:
    """Add a device and poll it; with `probe` only if it answers."""
    profile = await profile_of(parameters.profile, context.config.now)
    _check_new(parameters, profile, context.config.now, context.reconfiguration.reserved())
    if parameters.probe:
        await _ping(parameters.slave, profile, context)

    def edit(now: Effective) -> Changes:
        _check_new(parameters, profile, now, context.reconfiguration.reserved())
        place = Place(parameters.slave) if parameters.probe else None
        return now.changes.adding(parameters.device, parameters.entry, place)

    _, now = await apply_edit(edit, context)
    slave = known_device(parameters.device, now)
    data = {"slave": slave.id, **as_json(slave, SHOWN)}
    context.publisher.applied("device/add", command, device=slave.name, **{"from": None, "to": data})
    return ok({"device": slave.name, **data})


async def profile_of(word: str, now: Effective) -> Profile:
    """Return a profile by its name or file; the file must be in use already, or lie beside the configuration.

    Raises RefusedError for anything else.
    """
    known = now.loaded.profiles.get(word)
    if known is not None:
        return known
    path = Path(word)
    beside = not path.is_absolute() and ".." not in path.parts and path.suffix in {".yaml", ".yml"}
    if word in builtin_names() or beside:
        try:
            return await run_in_thread(
                partial(load_profile, word, relative_to=now.file.path.parent.absolute()), "profile"
            )
        except ConfigError:
            pass  # what is in a file is not told to whoever asks
    names = ", ".join(builtin_names())
    message = f"profile: {quoted(word)} is no profile; write {names}, or a profile's YAML file beside the configuration"
    raise refuse("invalid_param", message, param="profile")


def _check_new(wanted: NewDevice, profile: Profile, now: Effective, reserved: Mapping[int, str]) -> None:
    """Raise RefusedError if the device cannot be added: its id or name is taken."""
    config = now.config
    slave = inherited(SlaveConfig.model_construct(name=wanted.device, **wanted.entry), config.poll)
    alone = config.model_copy(update={"slaves": (slave,)})
    for found in contradictions(alone, {wanted.profile: profile}):
        param = {"id": "slave"}.get(str(found.path[-1]), str(found.path[-1]))
        raise refuse("invalid_param", f"{param}: {found.message}", param=param)
    for other in config.slaves:
        if any(wanted.slave == place.id for place in (Place(other.id), *now.places[other.name])):
            raise refuse("address_in_use", f"slave id {wanted.slave} is that of {other.name}", param="slave")
    if wanted.slave in reserved:
        raise refuse("address_in_use", f"slave id {wanted.slave} {reserved[wanted.slave]}", param="slave")
    if now.slave(wanted.device) is not None or now.changes.of(wanted.device).added is not None:
        default = "" if wanted.name else "the default "
        message = f"name: {default}{wanted.device} is taken; give it another name"
        raise refuse("invalid_param", message, param="name")


async def _ping(slave: int, profile: Profile, context: Context) -> None:
    """Raise RefusedError unless the slave answers."""
    ping = await context.line.ping(slave, profile)
    if ping.answered:
        return
    if ping.fault is None:
        raise refuse("line_error", f"slave {slave} could not be probed: the port is lost")
    heard = f" (received {ping.fault.heard.hex(' ').upper()})" if ping.fault.heard else ""
    message = f"slave {slave} does not answer: {ping.fault.message}{heard}; with probe false it is added all the same"
    raise refuse("timeout", message)


async def remove(parameters: OneDevice, context: Context, command: Command) -> Result:
    """Remove a device: it is no longer polled."""
    device = parameters.device

    def edit(now: Effective) -> Changes:
        if now.changes.of(device).added is None:  # else it may be one that cannot be polled as things are
            known_device(device, now)
        return now.changes.removing(device, now.file_values)

    before, _ = await apply_edit(edit, context)
    gone = before.slave(device)
    data = None if gone is None else {"slave": gone.id, **as_json(gone, SHOWN)}
    context.publisher.applied("device/remove", command, device=device, **{"from": data, "to": None})
    return ok({"device": device, "slave": None if gone is None else gone.id})


async def options(parameters: Options, context: Context, command: Command) -> Result:
    """Change the interval, label or time-out of a device, or whether it is polled."""
    device, wanted = parameters.device, parameters.wanted

    def edit(now: Effective) -> Changes:
        known_device(device, now)
        changes = now.changes.setting(device, wanted, now.file_values)
        why = effective(now.file, changes).suspended.get(device)
        if why is not None:
            param = why.partition(":")[0]
            raise refuse("invalid_param", why, param=param if param in wanted else None)
        return changes

    if not wanted:
        raise refuse("invalid_param", f"nothing to change: give {', '.join(OPTIONS[:-1])} or {OPTIONS[-1]}")
    before, now = await apply_edit(edit, context)
    keys = tuple(wanted)
    old, new = as_json(known_device(device, before), keys), as_json(known_device(device, now), keys)
    if old != new:
        context.publisher.applied("device/options", command, device=device, **{"from": old, "to": new})
    return ok({"from": old, "to": new})


async def read(parameters: OneDevice, context: Context, _: Command) -> Result:
    """Poll a device now, in turn with the others."""
    device = parameters.device
    known_device(device, context.config.now)
    conflict = context.config.now.conflicts.get(device)
    if conflict is not None:
        return failed("line_error", f"{device} cannot be polled: {conflict}")
    result = await context.line.read(device)
    if result is None:
        return failed("line_error", f"{device} was removed or changed before it could be polled")
    fault = result.fault
    if fault is None:
        return ok(result.sample)
    facts = {} if fault.exception_code is None else {"exception_code": fault.exception_code}
    code: ErrorCode = "timeout" if fault.code is FaultCode.TIMEOUT else "line_error"
    return failed(code, f"{device}: {fault.message}", data=result.sample, **facts)
