"""What is told of a poll that is over, or was cut off: one reading."""

from __future__ import annotations

from collections.abc import Iterable

from lfs10d.jobs.poll import Poll
from lfs10d.reading import Errand, Fault, Reading
from lfs10d.roster import Device


def tell(poll: Poll) -> Reading:
    """Return the reading of a poll that is over; its device knows of it already."""
    return _reading(poll.device, poll.at, poll.fault, poll, [poll])


def tell_lost(device: Device, fault: Fault, now: float, polls: Iterable[Poll]) -> Reading:
    """Return the reading of a device whose port is lost, in answer to the requested among `polls` of it too."""
    return _reading(device, now, fault, None, (poll for poll in polls if poll.device is device))


def _reading(device: Device, at: float, fault: Fault | None, poll: Poll | None, polls: Iterable[Poll]) -> Reading:
    overruns, device.overruns = device.overruns, 0
    return Reading(
        device=device.name,
        at=at,
        values=poll.good if poll else None,
        fault=fault,
        rtt=poll.rtt if poll else None,
        online=device.online,
        response_timeout=device.timeout,
        probe=poll is not None and poll.errand is Errand.PROBE,
        failed_attempts=tuple(poll.failed_attempts) if poll else (),
        overruns=overruns,
        requests=tuple(each.request for each in polls if each.request is not None),
        request_gap=device.gap.seconds,
        gap_learned=device.gap.learned > device.gap.configured,
    )
