"""`register/read` and `register/write`: raw access to what a slave holds, within what its profile permits.

Rules
-----
1. Nothing is sent to slave 0: all devices would obey, and nobody answer.
2. What sets a slave id or a baud rate is left to `device/readdress` and `line/baudrate`, which verify it; what triggers
   an action (a motor that starts) is never written. At a slave that is not configured that holds for every profile.
3. Nothing is written at a slave id that a physical change is about, while that is open.
4. Of a configured device only what its profile marks as a writable setting is written, within the setting's range.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from lfs10d.command import Command, ErrorCode, Result, failed, ok, rejected
from lfs10d.commands.context import Context
from lfs10d.commands.handlers.config_edit import known_device, refuse
from lfs10d.commands.message import Parameters
from lfs10d.config.effective import Effective
from lfs10d.config.models import SlaveConfig
from lfs10d.line.jobs.access_end import End
from lfs10d.modbus.request import READ_COUNT_MAX, ReadRegisters, WriteRegister
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.profiles.settings import Setting
from lfs10d.reading import FaultCode
from lfs10d.schema.fields import Name, Whole

if TYPE_CHECKING:  # as in `lfs10d.commands.context`
    from lfs10d.line.jobs.register_access import Access

REGISTERS = 0x1_0000
"""Register addresses and contents have 16 bits (Modbus Application Protocol V1.1b3, section 4.4)."""


class OnePlace(Parameters):
    """A register of a device, given by `device` or by `slave`."""

    device: Annotated[str, Name()] | None = Field(None, description="The device, by its name.")
    slave: Annotated[int, Whole(0, 255)] | None = Field(
        None, description="Or its slave id, 1 to 255; no device need be configured there."
    )
    address: Annotated[int, Whole(0, REGISTERS - 1)] = Field(description="The (first) register, as on the wire.")


class SomeRegisters(OnePlace):
    """The parameters of `register/read`."""

    count: Annotated[int, Whole(1, READ_COUNT_MAX)] = Field(1, description="How many registers.")


class OneRegister(OnePlace):
    """The parameters of `register/write`."""

    value: Annotated[int, Whole(0, REGISTERS - 1)] = Field(description="What the register is to hold, unscaled.")


async def read(parameters: SomeRegisters, context: Context, _: Command) -> Result:
    """Read registers with function 03, unscaled."""
    now = context.config.now
    address, count = parameters.address, parameters.count
    device, slave = _target(parameters, now)
    if address + count > REGISTERS:
        raise refuse("invalid_param", f"count: there are {REGISTERS - address} registers from there", param="count")
    profile = None if device is None else now.loaded.profiles[device.profile]
    most = READ_COUNT_MAX if profile is None else profile.most_words
    if count > most:
        kind = "slave" if profile is None else profile.title
        raise refuse("invalid_param", f"count: one read of a {kind} brings at most {most} registers", param="count")
    access = await context.line.access(ReadRegisters(slave, address, count), device)
    place = {"device": device and device.name, "slave": slave, "address": address}
    if access.end is End.DONE:
        return ok({**place, "registers": list(access.registers or ())})
    return _ended(access, f"slave {slave}")


async def write(parameters: OneRegister, context: Context, command: Command) -> Result:
    """Write one register with the profile's write function and read it back; only settings that the profile marks."""
    now = context.config.now
    address, value = parameters.address, parameters.value
    device, slave = _target(parameters, now)
    if device is None:
        _check_unknown(address, now)
    else:
        _check_setting(address, value, now.loaded.profiles[device.profile])
    reserved = context.reconfiguration.reserved().get(slave)
    if reserved is not None:
        raise refuse("busy", f"slave id {slave} {reserved}; write when that is over")
    function = 6 if device is None else now.loaded.profiles[device.profile].write_function
    access = await context.line.access(WriteRegister(slave, address, value, function), device)
    place = {"device": device and device.name, "slave": slave, "address": address}
    if access.end is End.DONE:
        context.publisher.applied("register/write", command, **place, **{"from": access.before, "to": value})
        return ok({**place, "value": value, "before": access.before})
    data = None if access.registers is None else {**place, "value": access.registers[0], "before": access.before}
    return _ended(access, f"slave {slave}", data=data, writes=True)


def _target(parameters: OnePlace, now: Effective) -> tuple[SlaveConfig | None, int]:
    """Return the device, None if none is configured there, and its slave id; raises RefusedError."""
    match parameters.device, parameters.slave:
        case (str(name), None):
            device = known_device(name, now)
            conflict = now.conflicts.get(name)
            if conflict is not None:
                raise refuse("line_error", f"{name} cannot be accessed: {conflict}")
            return device, device.id
        case (None, 0):
            raise refuse("not_allowed", "slave 0 is the broadcast address: nothing is ever sent to it", param="slave")
        case (None, int(slave)):
            return next((each for each in now.polled.slaves if each.id == slave), None), slave
        case (None, None):
            raise refuse("invalid_param", "device: is missing; or give slave, a slave id", param="device")
        case _:
            raise refuse("invalid_param", "device: give either device or slave", param="device")


def _check_unknown(address: int, now: Effective) -> None:
    """Raise RefusedError where a slave that is not configured must not be written."""
    builtin = (load_profile(name, relative_to=now.file.path.parent) for name in builtin_names())
    for profile in (*builtin, *now.loaded.profiles.values()):
        _check_harmless(address, profile)


def _check_harmless(address: int, profile: Profile) -> None:
    what = f"0x{address:04X} of a {profile.title}"
    if profile.slave_id is not None and address == profile.slave_id.register:
        raise refuse("not_allowed", f"{what} sets its slave id: use device/readdress", param="address")
    if profile.baudrate is not None and address == profile.baudrate.register:
        raise refuse("not_allowed", f"{what} sets its baud rate: use line/baudrate", param="address")
    if address in profile.run_commands:
        raise refuse("not_allowed", f"{what} triggers an action: it is never written", param="address")


def _check_setting(address: int, value: int, profile: Profile) -> None:
    """Raise RefusedError unless the profile lets this be written."""
    _check_harmless(address, profile)
    setting = profile.setting_at(address)
    if setting is None or not setting.writable:
        named = "no setting" if setting is None else f"{setting.name}, which is not marked writable,"
        message = f"0x{address:04X} is {named} in profile {profile.name}; writable are: {_writable(profile.settings)}"
        raise refuse("not_allowed", message, param="address")
    refusal = setting.refusal(value)
    if refusal is not None:
        raise refuse("invalid_param", f"value: {refusal}", param="value")


def _writable(settings: Iterable[Setting]) -> str:
    return ", ".join(f"0x{each.register:04X} ({each.name})" for each in settings if each.writable) or "none"


def _ended(access: Access, who: str, *, data: object = None, writes: bool = False) -> Result:
    """Return the result of an access that failed; `rejected` if no write was sent."""
    code, words = _why(access)
    fault = access.fault
    facts: dict[str, Any] = {}
    if fault is not None and fault.exception_code is not None:
        facts["exception_code"] = fault.exception_code
    if writes and not access.sent:
        return rejected(code, f"{who}: {words}; nothing was written", **facts)
    return failed(code, f"{who}: {words}", data=data, **facts)


def _why(access: Access) -> tuple[ErrorCode, str]:
    """Return the error code and the message."""
    fault = access.fault
    said = "the port is lost" if fault is None else fault.message
    match access.end:
        case End.REFUSED:
            return "refused", said
        case End.BUSY:
            return "busy", said
        case End.NOT_VERIFIED if access.registers is not None:
            return "not_verified", f"the register holds {access.registers[0]} and not what was written"
        case End.NOT_VERIFIED:
            return "not_verified", f"what was written cannot be read back: {said}"
        case End.ECHO_UNKNOWN:
            return "line_error", "it cannot be learned whether the adapter returns our own bytes; set line.echo"
    silent = fault is not None and fault.code in (FaultCode.TIMEOUT, FaultCode.LATE)
    return "timeout" if silent else "line_error", said
