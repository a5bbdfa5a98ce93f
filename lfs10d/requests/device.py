"""`device/read`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from lfs10d.admission import Form
from lfs10d.commands import Answer, Parameters, failed, ok, rejected
from lfs10d.kinds import Name
from lfs10d.reading import FaultCode
from lfs10d.requests.request import Powers, Request

if TYPE_CHECKING:
    from collections.abc import Mapping

    from lfs10d.commands import Call, ErrorCode


class OneDevice(Parameters):
    """Which device."""

    device: Annotated[str, Name()]


def unknown_device(device: str, powers: Powers) -> Answer:
    """Return the rejection of a name that no device has."""
    known = ", ".join(powers.devices()) or "none"
    return rejected("unknown_device", f"there is no device {device}; configured are: {known}", param="device")


async def read(parameters: OneDevice, powers: Powers, _: Call) -> Answer:
    """Poll a device now, in turn with everybody else."""
    device = parameters.device
    if device not in powers.devices():
        return unknown_device(device, powers)
    inquiry = await powers.read(device)
    if inquiry is None:
        return failed("line_error", f"{device} was removed or changed before it could be asked")
    fault = inquiry.fault
    if fault is None:
        return ok(inquiry.sample)
    facts = {} if fault.exception_code is None else {"exception_code": fault.exception_code}
    code: ErrorCode = "timeout" if fault.code is FaultCode.TIMEOUT else "line_error"
    return failed(code, f"{device}: {fault.message}", data=inquiry.sample, **facts)


REQUESTS: Mapping[str, Request] = {"device/read": Request(Form("polling", OneDevice), read)}
