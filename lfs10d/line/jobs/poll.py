"""Polls: reads a device's values once, with retries as later exchanges; a probe is a poll of an offline device.

Rules
-----
1. While a late answer could pass for a value's, the slave is asked its profile's barrier first, by retries too; see
   `lfs10d.modbus.pending`. Probes begin with the barrier always. Where the profile has none the slave is left
   alone until nothing can be pending.
2. A failed exchange is tried again, `retries` times, as a later exchange. An exception or a value out of range is not:
   the answer would be the same.
3. One poll has one outcome, however many exchanges it took.
4. What is read is decided when it begins (`lfs10d.line.read_plan`); where the device refuses registers that are
   optional, the others are read in the same poll. A value that is there by itself is none where its registers say so;
   the poll fails only where no value is there, with the fault of the first.
5. A device that sleeps (`lfs10d.line.request_gap`) may lose the first request after a pause: it is asked again at once,
   and where that has helped before the silence is no failed attempt. It is woken by its barrier, where it has one,
   so that the value can be asked right after it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import lru_cache

from lfs10d.line.device import Device
from lfs10d.line.jobs.job import Done, Hold, Next, Requeue
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.exchange import FAULT_HEARD
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.request import ReadRegisters
from lfs10d.profiles.blocks import Block
from lfs10d.reading import ALIVE_CODES, NOTHING, Fault, FaultCode, Purpose, Reading, Value

WAKES = 3
"""Most silences within one poll that are taken for a sleeping device."""
_NOTHING: frozenset[int] = frozenset()


def marked_busy(fault: Fault, exceptions: tuple[int, ...]) -> Fault:
    """Return the fault, marked as busy where its exception is one of those that mean so."""
    return replace(fault, busy=True) if fault.exception_code in exceptions else fault


@lru_cache(maxsize=1024)
def _read(slave: int, address: int, count: int, function: int) -> ReadRegisters:
    """Return a request, the same object for the same read, which is repeated and used as a key."""
    return ReadRegisters(slave, address, count, function)


class Poll:
    """One poll of `device`; `due` orders it among the others. `request` is the number of the request that wants it.

    `begun`: something was put on the line for it. When it is over `values` or `fault` is set, `at` says when, `rtt` how
    long the last exchange took. `faults` say why single values are None, `ages` (s) which are old.
    """

    share = 1.0
    excludes = _NOTHING

    def __init__(
        self, device: Device, pending: PendingRequests, *, due: float, purpose: Purpose, request: int | None = None
    ) -> None:
        self.device = device
        self.purpose = purpose
        self.request = request
        self.due = due
        self.values: dict[str, Value | None] = {}
        self.faults: dict[str, Fault] = {}
        self.ages: Mapping[str, float] = NOTHING
        self.fault: Fault | None = None
        self.rtt: float | None = None
        self.at = due
        self.failed_attempts: list[FaultCode] = []
        self._pending = pending
        self._blocks: tuple[Block, ...] = ()
        self._block = 0
        self._retries = device.retries if purpose is not Purpose.PROBE else 0
        self._barrier_due = purpose is Purpose.PROBE
        self._barrier_asked = False
        self.begun = False
        self._waking = False
        self._wakes = 0

    @property
    def good(self) -> Mapping[str, Value | None] | None:
        """The values; None where the poll failed."""
        return self.values if self.fault is None else None

    def ask(self, now: float) -> Ask | Hold:
        """Return the next request, or a decision to wait."""
        device = self.device
        codec, profile = device.spec.codec, device.spec.profile
        if not self._blocks:
            everything = self.purpose is Purpose.REQUEST
            self._blocks = device.reads.reads(now, device.spec.interval, everything=everything)
        self._waking = self._wakes < WAKES and device.gap.may_sleep(now)
        block, barrier, usual = self._blocks[self._block], profile.barrier, device.timeout
        value = _read(device.slave, block.address, block.count, block.function)
        request = self._pending.next_request(
            value,
            codec,
            now,
            barrier=None if barrier is None else _read(device.slave, barrier.address, barrier.count, barrier.function),
            timeout=usual,
            barrier_first=self._barrier_due
            or (self._waking and device.gap.sleeps)
            or device.slave in self._pending.barrier_first,
        )
        if isinstance(request, float):
            return Hold(request)
        self._barrier_asked = request is not value
        timeout = device.probe_timeout if self.purpose is Purpose.PROBE else usual
        return Ask(request, codec, timeout, device.patience)

    def on_outcome(self, outcome: Outcome, now: float) -> Next:
        """Take the outcome of the request."""
        device = self.device
        self.at = outcome.ended
        self.begun = True
        fault = outcome.fault
        waking, self._waking = self._waking, False
        if waking and fault is not None and fault.code is FaultCode.TIMEOUT:
            self._wakes += 1
            if not device.gap.sleeps:
                self.failed_attempts.append(fault.code)
            self._barrier_due = False
            return Requeue(self.due)
        if outcome.late and (fault is None or fault.code is not FaultCode.LATE):  # else the attempt is counted as late
            self.failed_attempts += [
                FaultCode.LATE for late in outcome.late if late.ours and late.request.slave == device.slave
            ]
        if self._barrier_asked:
            alive = fault is None or (
                fault.code is FaultCode.EXCEPTION and not outcome.ambiguous and not outcome.may_follow
            )
            if alive:
                self._barrier_due = False
                return Requeue(self.due)
        elif fault is None and outcome.answer is not None:
            fault = self._blocks[self._block].take(outcome.answer, self.values, self.faults)
            if fault is None:
                self.rtt = outcome.rtt
                self._block += 1
                return self._go_on(outcome.heard)
            fault = replace(fault, heard=outcome.heard[-FAULT_HEARD:])
        elif fault is not None and not outcome.ambiguous and self._reads_otherwise(fault, now):
            return self._go_on(outcome.heard)
        if fault is not None and fault.code not in ALIVE_CODES and self._retries > 0:
            self._retries -= 1
            self.failed_attempts.append(fault.code)
            self.due = now
            return Requeue(now)
        self._fail(None if fault is None else marked_busy(fault, device.spec.profile.busy_exceptions))
        return Done()

    def _reads_otherwise(self, fault: Fault, now: float) -> bool:
        """Whether the read was refused for registers that are optional: then others take its place."""
        place = self._block
        instead = self.device.reads.refused(self._blocks[place], fault, now)
        if instead is None:
            return False
        self._blocks = (*self._blocks[:place], *instead, *self._blocks[place + 1 :])
        return True

    def _go_on(self, heard: bytes) -> Next:
        """Read the next block; after the last one complete the values."""
        if self._block < len(self._blocks):
            return Requeue(self.due)
        device, names = self.device, self.device.reads.value_names
        if not device.reads.simple:
            self.ages = device.reads.complete(self.values, self.faults, self.at, device.spec.interval)
        if self.faults and all(self.values[name] is None for name in names):
            fault = next(self.faults[name] for name in names if name in self.faults)
            self._fail(replace(fault, heard=fault.heard or heard[-FAULT_HEARD:]))
        elif len(names) > 1:
            self.values = {name: self.values[name] for name in names}
        return Done()

    def _fail(self, fault: Fault | None) -> None:
        self.fault = fault
        self.values, self.faults, self.ages, self.rtt = {}, {}, NOTHING, None

    def cut_off(self, now: float) -> None:
        """Note that the port is lost."""
        self.at = now

    def reading(self) -> Reading:
        """Return the reading of the poll that is over; its device knows of it already."""
        return _reading(self.device, self.at, self.fault, () if self.request is None else (self.request,), self)


def lost_reading(device: Device, fault: Fault, now: float, polls: Iterable[Poll]) -> Reading:
    """Return the reading of a device whose port is lost, also for the requested ones among its `polls`."""
    requests = tuple(each.request for each in polls if each.device is device and each.request is not None)
    return _reading(device, now, fault, requests, None)


def _reading(device: Device, at: float, fault: Fault | None, requests: tuple[int, ...], poll: Poll | None) -> Reading:
    overruns, device.overruns = device.overruns, 0
    return Reading(
        device=device.spec.name,
        at=at,
        values=poll.good if poll else None,
        fault=fault,
        rtt=poll.rtt if poll else None,
        online=device.online,
        response_timeout=device.timeout,
        probe=poll is not None and poll.purpose is Purpose.PROBE,
        failed_attempts=tuple(poll.failed_attempts) if poll else (),
        overruns=overruns,
        requests=requests,
        value_errors={name: each.code for name, each in poll.faults.items()} if poll and poll.faults else NOTHING,
        ages=poll.ages if poll else NOTHING,
        request_gap=device.gap.seconds,
        gap_learned=device.gap.learned > device.gap.configured,
    )
