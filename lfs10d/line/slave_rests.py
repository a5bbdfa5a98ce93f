"""Until when each slave must not be asked: its pause after the last exchange (`request_gap`). Pure.

Rules
-----
1. Before each request a slave has its rest (`lfs10d.line.request_gap`), counted from the end of any exchange with it.
2. Ids that belong to one job and to no device may be any of the job's: a sensor that is moved rests at both places.
   What must be asked at once, at a place where nobody is expected, does not wait.
3. A poll begins no sooner after the one before than the profile's `min_interval` says, whoever wants it.
4. Only what is asked at the line's own rate teaches what rest a slave needs.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

from lfs10d.line.device import Device
from lfs10d.line.jobs.job import Job
from lfs10d.line.jobs.poll import Poll
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.outcome import Outcome
from lfs10d.reading import FaultCode


class SlaveRests:
    """The last exchange with each slave id of one line; `devices` of each call are the configured ones by slave id."""

    def __init__(self) -> None:
        self._ended: dict[int, float] = {}

    def until(self, job: Job, ask: Ask, devices: Mapping[int, Device]) -> float:
        """Return until when the request of `job` must wait; in the past if it need not."""
        slave, gap, until = ask.request.slave, ask.request_gap, -inf
        if ask.at_once:
            return until
        device = devices.get(slave)
        if device is not None:
            gap = max(gap, device.gap.seconds)
            if isinstance(job, Poll) and not job.begun:
                until = device.polled_at + device.spec.profile.min_interval
        ids = {slave}
        if job.excludes and len(job.excludes) > 1:
            ids |= {each for each in job.excludes if each not in devices or slave not in devices}
            if len(ids) > 1:
                gap = max(gap, *(devices[each].gap.seconds for each in job.excludes if each in devices), 0.0)
        if gap > 0:
            until = max(until, *(self._ended.get(each, -inf) + gap for each in ids))
        return until

    def abandoned(self, slave: int, now: float) -> None:
        """Note that an exchange with `slave` was cut off."""
        self._ended[slave] = now

    def learn(self, outcome: Outcome, ask: Ask, devices: Mapping[int, Device], *, line_rate: int) -> bool:
        """Note an exchange that is over; return whether its slave gets a longer rest."""
        slave, began = outcome.request.slave, outcome.began
        if began is None:
            return False
        self._ended[slave] = outcome.ended
        for late in outcome.late:
            if (tardy := devices.get(late.request.slave)) is not None:
                tardy.gap.late()
        device = devices.get(slave)
        if device is None or ask.baudrate not in (None, line_rate):
            return False
        fault = outcome.fault
        silent = fault is not None and fault.code is FaultCode.TIMEOUT
        return device.gap.exchanged(began, outcome.ended, spoke=outcome.answered, silent=silent)
