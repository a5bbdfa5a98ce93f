"""Searches at the other rates after every sensor has been offline for some time. Pure; writes nothing.

It reports what was found and uses nothing of it: a line at the wrong rate is for a person, or for `line/baudrate`, to
put right.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator, Iterable
from math import inf
from typing import Any, TypeAlias

from lfs10d.line.device import Device
from lfs10d.line.jobs.identification import first_read, speaks
from lfs10d.line.jobs.job import Hold
from lfs10d.line.jobs.procedure import Await, ProcedureClock, Step
from lfs10d.line.probing import PROBE_SPACING
from lfs10d.modbus.ask import Ask

LOST_AFTER = 30.0
"""Seconds for which every sensor must be offline."""
TIMEOUT = 0.2
"""Time-out of each read, in s."""

Found: TypeAlias = "dict[str, int]"
"""The rate at which each device answered that did."""


def find_other_rates(
    devices: Callable[[], Iterable[Device]], clock: ProcedureClock, line_rate: int
) -> Generator[Step, Any, None]:
    """Read one device after the other, between the probes, at each other rate of its profile; report what was found.

    `Found` is awaited whenever it changes; it is empty again when a device answers at the line's rate.
    """
    found: Found = {}
    since = inf
    turn = 0
    while True:
        yield Hold(clock.now + PROBE_SPACING)
        polled = [device for device in devices() if device.spec.enabled]
        if not polled or any(device.online for device in polled):
            since = inf
            if found:
                found = {}
                yield Await({})
            continue
        since = min(since, clock.now)
        if clock.now < since + LOST_AFTER:
            continue
        turn += 1
        device = polled[turn % len(polled)]
        rates = device.spec.profile.baudrate.codes if device.spec.profile.baudrate else ()
        for rate in rates:
            if rate == line_rate:
                continue
            request = first_read(device.spec.profile, device.slave)
            outcome = yield Ask(request, device.spec.codec, TIMEOUT, None, rate)
            if speaks(outcome, device.spec.codec) and found.get(device.name) != rate:
                found = {**found, device.name: rate}
                yield Await(dict(found))


def message(found: Found, line_rate: int, polled: int, *, filed: int) -> str:
    """Return the message: what was found, and what to do.

    `filed` is `line.baudrate` of the file; it differs from the `line_rate` where line/baudrate has moved the line.
    """
    counts = Counter(found.values())
    at = " and ".join(f"{counts[rate]} of {polled} at {rate}" for rate in sorted(counts))
    what = f"no sensor answers at {line_rate} baud, but {at} baud do ({', '.join(sorted(found))})"
    best = max(sorted(counts), key=counts.__getitem__)
    if best == filed:
        # The file's rate counts only once a person edits it: the move was recorded beside what the file says.
        advice = f"set line.baudrate to {line_rate} and reload, then to {best} and reload"
    else:
        advice = f"set line.baudrate to {best}"
    if len(counts) == 1:
        return f"{what}; {advice}; then line/baudrate can move them"
    return f"{what}; leave only those of one rate on the line; for {best}: {advice}; then line/baudrate can move them"
