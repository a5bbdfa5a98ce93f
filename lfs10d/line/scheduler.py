"""Decides what is asked next on the line. Pure: the bus carries out one `Ask` at a time, so no lock is needed.

Rules
-----
1. In this order: jobs without a share (requests); jobs within their share of the line (scans, changes) and probes
   (`lfs10d.line.probing`); polls (`lfs10d.line.poll_queue`). While no device answers, polls go before probes.
2. A slave id that a job excludes is not polled while the job runs.
3. When the port is lost every device is offline and gets one reading; nothing is due until it is back, then every
   device is due at once.
4. A device that is never heard, or probed in turn with others, and is silent right after another was silent, is asked
   once more at once: some sensors ignore the request after one to a dead neighbour.
5. A slave is given its rest before each request (see `slave_rests`): a job that wants to ask it sooner is held.
6. One poll, one reading; none if its device is no longer configured, or no longer enabled and nobody requested it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

from lfs10d.line.device import Device, DeviceSpec, Health, PollRules
from lfs10d.line.devices import Devices
from lfs10d.line.job_queue import JobQueue
from lfs10d.line.jobs.job import Continue, Hold, Job, Requeue
from lfs10d.line.jobs.poll import Poll, lost_reading
from lfs10d.line.poll_queue import PollQueue, back_on_grid, spread
from lfs10d.line.probing import Probing
from lfs10d.line.second_answers import SecondAnswers
from lfs10d.line.slave_rests import SlaveRests
from lfs10d.line.surcharge import Surcharge
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.request import ReadRegisters
from lfs10d.modbus.timing import LineTiming
from lfs10d.reading import Fault, FaultCode, Purpose, Reading
from lfs10d.system.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Rest:
    """Nothing is to be asked before `until` (inf: before something is submitted)."""

    until: float


Decision: TypeAlias = Ask | Rest


class Scheduler:
    """The devices of one line and the jobs on it; `now` is the line's clock at the beginning.

    `timing` is that of the line's own rate. The port counts as open until `on_port_lost`.
    """

    def __init__(self, timing: LineTiming, now: float) -> None:
        self.timing = timing
        self.pending = PendingRequests()
        self.devices = Devices()
        self.second_answers = SecondAnswers(self.pending)
        self._polls = PollQueue(self.pending)
        self._probing = Probing(now)
        self._jobs = JobQueue()
        self._surcharge = Surcharge()
        self._current: tuple[Job, Ask] | None = None
        self._silent: int | None = None
        self._lost: Fault | None = None
        self._rests = SlaveRests()

    # -- what is to be polled

    def replace(self, specs: Iterable[DeviceSpec], rules: PollRules, now: float) -> None:
        """Poll these devices from `now` on; those that stay keep their health, their grid and their turn.

        One that is enabled again, or whose slave id, profile or codec changed, is a new one on the line.
        """
        fresh = self.devices.replace(specs, rules, port_lost=self._lost is not None)
        self.second_answers.watch(self.devices.by_slave)
        for device in fresh:
            self.pending.duplicates.forget(device.slave)
        for job in self._jobs.drop(lambda job: isinstance(job, Poll) and not self._wanted(job)):
            job.cut_off(now)
        self._requeue(fresh, now)

    def _requeue(self, fresh: list[Device], now: float) -> None:
        """Rebuild the queue of polls, with new grids for `fresh`."""
        polled = [device for device in self.devices.values() if device.spec.enabled]
        if polled:
            enabled = [device for device in fresh if device.spec.enabled]
            spread(enabled, polled=len(polled), wire_time=_wire_time(polled[0], self.timing), now=now)
        kept = [poll for poll in self._polls.polls() if self._wanted(poll)]
        self._polls.clear()
        for poll in kept:
            self._polls.resume(poll, poll.due)
        for device in polled:
            if not device.polling:
                self._polls.enqueue(device)
        self._probing.review(polled, now)

    def _wanted(self, poll: Poll) -> bool:
        """Whether the reading of this poll is wanted (rule 5)."""
        device = poll.device
        useful = device.spec.enabled or poll.purpose is Purpose.REQUEST
        return useful and self.devices.get(device.spec.name) is device

    # -- jobs

    def submit(self, job: Job, now: float) -> list[Reading]:
        """Take a job; it is asked as soon as its class and its share allow. While the port is lost it is cut off."""
        wanted, lost = not isinstance(job, Poll) or self._wanted(job), self._lost
        if wanted and lost is None:
            self._jobs.submit(job, now, self._probing.account if job.purpose is Purpose.PROBE else None)
            return []
        job.cut_off(now)
        if not wanted or lost is None or not isinstance(job, Poll):
            return []
        return [lost_reading(job.device, lost, now, [job])]

    def wake(self, job: Job, now: float) -> None:
        """End the `Hold` of `job`."""
        if self._jobs.wake(job):
            self._resume(job, now)

    # -- the port

    def on_port_lost(self, fault: Fault, now: float) -> list[Reading]:
        """Note that the port is lost: one reading per device that is or was asked to be polled; every job is over.

        While it is lost already only the reason is noted.
        """
        if self._lost is not None:
            self._lost = fault
            return []
        jobs = [*self._jobs.drop(lambda _: True), *self._polls.polls()]
        if self._current is not None:
            job, ask = self._current
            self._jobs.over(job)
            jobs.append(job)
            self.pending.abandoned(ask.request, ask.codec, ask.timeout, now)
            self._rests.abandoned(ask.request.slave, now)
        for job in jobs:
            job.cut_off(now)
        self._current = None
        self._lost = fault
        self._polls.clear()
        self._probing.stop()
        for device in self.devices.values():
            device.cut_off()
        polls = [job for job in jobs if isinstance(job, Poll) and self._wanted(job)]
        wanted = {poll.device.name for poll in polls if poll.purpose is Purpose.REQUEST}
        told = [device for device in self.devices.values() if device.spec.enabled or device.name in wanted]
        return [lost_reading(device, fault, now, polls) for device in told]

    def retime(self, timing: LineTiming) -> None:
        """Take the times of the line's new rate; what was learned at another rate is forgotten."""
        if timing.baudrate != self.timing.baudrate:
            self.devices.forget_response_times()
        self.timing = timing

    def on_port_opened(self, now: float) -> None:
        """Note that the port is open: every device is due at once."""
        self._lost = None
        self.pending.duplicates.forget()
        for device in self.devices.values():
            device.reconnected()
        self._requeue(list(self.devices.values()), now)

    # -- what is asked next

    def next(self, now: float) -> Decision:
        """Decide what is asked next; the outcome of an `Ask` must come back through `on_outcome`."""
        if now < self.second_answers.quiet.until:
            return Rest(self.second_answers.quiet.until)
        for job in self._jobs.released(now):
            self._resume(job, now)
        while (chosen := self._choose(now)) is not None:
            decision = chosen.ask(now)
            if isinstance(decision, Ask):
                until = self._rests.until(chosen, decision, self.devices.by_slave)
                if until <= now:
                    self._begin(chosen, decision, now)
                    return decision
                self._surcharge.released()
                decision = Hold(until)
            if isinstance(decision, Hold):
                self._jobs.hold(chosen, decision)
            else:
                self._jobs.over(chosen)
        return Rest(min(self._probing.next_at, self._polls.next_due(), self._jobs.next_at(now)))

    def patient(self, now: float) -> bool:
        """Whether the line need not hurry; with a device of interval 0 or a job that waits for it, it must."""
        job = self._current[0] if self._current else None
        flat_out = isinstance(job, Poll) and job.device.spec.interval == 0
        return self._jobs.idle(now) and not flat_out and now < self._probing.next_at and self._polls.patient(now)

    def _begin(self, job: Job, ask: Ask, now: float) -> None:
        self._current = job, ask
        self.pending.begin(ask.request.slave, ask.baudrate or self.timing.baudrate, now)
        if isinstance(job, Poll) and not job.begun:
            job.device.polled_at = now

    def _choose(self, now: float) -> Job | None:
        if (job := self._jobs.choose(now)) is not None:
            return job
        if not self._probing.anyone_online:
            return self._polls.choose(now, self._jobs.excluded) or self._choose_probe(now)
        probe = None if now < self._probing.next_at else self._choose_probe(now)
        return probe or self._polls.choose(now, self._jobs.excluded)

    def _choose_probe(self, now: float) -> Poll | None:
        if (device := self._probing.choose(now, self._jobs.excluded)) is None:
            return None
        device.polling = True
        device.last_asked = now
        return Poll(device, self.pending, due=now, purpose=Purpose.PROBE)

    def _resume(self, job: Job, key: float) -> None:
        if isinstance(job, Poll) and job.purpose is Purpose.POLL:
            self._polls.resume(job, key)
        else:
            self._jobs.resume(job)

    @property
    def purpose(self) -> Purpose:
        """The purpose of the exchange on the line."""
        return self._current[0].purpose if self._current else Purpose.POLL

    # -- what came of it

    def on_outcome(self, outcome: Outcome, now: float) -> list[Reading]:
        """Take the outcome of the last `Ask`; return the reading of a poll or probe that is over by it."""
        if self._current is None:
            raise RuntimeError("an outcome without an Ask")
        (job, ask), self._current = self._current, None
        poll = job if isinstance(job, Poll) else None
        self.pending.on_outcome(outcome, ask.codec, ask.timeout, now)
        at_line_rate = ask.baudrate in (None, self.timing.baudrate)
        doubtful = at_line_rate and self.second_answers.is_doubtful(outcome, ask.timeout)
        self.devices.learn(outcome, doubtful=doubtful)
        widened = self._rests.learn(outcome, ask, self.devices.by_slave, line_rate=self.timing.baudrate)
        if job.purpose is not Purpose.POLL:  # which has no share of its own
            self._spend(job, outcome, now)
        ignored = self._ignored(outcome)
        again = doubtful or widened or (ignored and poll is not None and self._benefits(poll.device))
        if again and poll is not None and self._wanted(poll):
            self._jobs.resume(poll)
            return []
        following = job.on_outcome(outcome, now)
        if isinstance(following, Continue):
            self._jobs.continue_slice(job)
            return []
        self._surcharge.released()
        if poll is not None and not self._wanted(poll):
            poll.cut_off(now)
            return []
        if isinstance(following, Requeue):
            self._resume(job, following.key)
            return []
        self._jobs.over(job)
        return [] if poll is None else [self._finish(poll, now)]

    def _ignored(self, outcome: Outcome) -> bool:
        """Whether the request may have been ignored because of the one before it (rule 4)."""
        before, self._silent = self._silent, None
        if outcome.fault is None or outcome.fault.code is not FaultCode.TIMEOUT:
            return False
        self._silent = outcome.request.slave
        return before not in (None, self._silent)

    def _benefits(self, device: Device) -> bool:
        """Whether a silence is to be checked by another exchange at once (rule 4)."""
        if device.starting:
            return False
        return device.health is Health.UNHEARD or device.probe_exempt or not self._probing.anyone_online

    def _spend(self, job: Job, outcome: Outcome, now: float) -> None:
        taken = outcome.ended - outcome.asked + self.timing.gap
        if job.purpose is Purpose.PROBE and isinstance(job, Poll):
            self._probing.spend(job.device, taken, now)
        elif job.purpose is Purpose.CHANGE:
            self._jobs.spend(job, self._charge(job, outcome), now)
        else:
            self._jobs.spend(job, taken, now)

    def _charge(self, job: Job, outcome: Outcome) -> float:
        """Return the line time that an exchange of a change is charged, with its surcharge."""
        others = [each for each in self.devices.values() if each.online and each.spec.enabled]
        intervals = [each.spec.interval for each in others if each.slave not in job.excludes]
        wire_time = _wire_time(others[0], self.timing) if others else 0.0
        ended = outcome.ended + self.timing.gap
        return self._surcharge.charge(job.share, outcome.asked, ended, intervals=intervals, wire_time=wire_time)

    def _finish(self, poll: Poll, now: float) -> Reading:
        device = poll.device
        before, was_doubtful = device.health, device.doubtful
        if poll.fault is None:
            device.answered()
        else:
            device.failed(poll.fault, now)
        doubtful = device.doubtful
        if poll.purpose is not Purpose.REQUEST:
            device.polling = False
        if (before is not Health.ONLINE and device.online) or (was_doubtful and not doubtful):
            back_on_grid(device, now)
        if device.starting:
            self.devices.hurry()
        if not device.polling:
            self._polls.enqueue(device)
        if device.health is not before or doubtful != was_doubtful:
            self._probing.review(self.devices.values(), now)
        elif doubtful:
            self._probing.plan(now)
        return poll.reading()


def _wire_time(device: Device, timing: LineTiming) -> float:
    block, codec = device.spec.profile.reads()[0], device.spec.codec
    request = ReadRegisters(device.slave, block.address, block.count, block.function)
    return timing.exchange(len(codec.encode(request)), codec.answer_size(request))
