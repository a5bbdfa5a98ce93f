"""Who speaks next on the line. Pure: it decides, the bus obeys, one `Ask` at a time; so no lock guards anything.

Rules
-----
1. In this order: jobs without a share (requests); jobs within their share of the line (scans, changes) and probes
   (`lfs10d.line.probing`); polls (`lfs10d.line.poll_queue`). While no device answers, polls go before probes.
2. A slave id that a job excludes is polled by nobody while the job runs.
3. When the port is lost every device is offline and gets one reading; nothing is due until it is back, then every
   device is due at once.
4. A device that is never heard, or probed in turn with others, and is silent right after another was silent, is asked
   once more at once: some sensors ignore the request after one to a dead neighbour.
5. A slave is given its rest before each request, whatever it is for (see `slave_rests`): a job that wants to ask
   it sooner is held, while others have the line.
6. One poll, one reading; none if its device is no longer configured, or no longer enabled and nobody requested it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

from lfs10d.line.device import LEARNED_MOST, Device, DeviceSpec, Health, PollRules
from lfs10d.line.job_queue import JobQueue
from lfs10d.line.jobs.job import Continue, Hold, Job, Requeue
from lfs10d.line.jobs.poll import Poll, lost_reading
from lfs10d.line.poll_queue import PollQueue, back_on_grid, spread
from lfs10d.line.probing import Probing
from lfs10d.line.slave_rests import SlaveRests
from lfs10d.line.surcharge import Surcharge
from lfs10d.modbus import diagnosis
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.frames import EXCEPTION_FLAG
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.overhearing import Overhearing
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.request import ReadRegisters
from lfs10d.modbus.timing import LineTiming
from lfs10d.reading import AnsweredTwice, Fault, FaultCode, Purpose, Reading


@dataclass(frozen=True, slots=True)
class Rest:
    """Nobody wants the line before `until` (inf: before somebody submits something)."""

    until: float


START_PATIENT = 8
"""With more silent devices than this at the start none of them is waited for longer than 200 ms."""

Decision: TypeAlias = Ask | Rest


class Scheduler:
    """The devices of one line and the jobs on it; `now` is the line's clock at the beginning.

    `timing` is that of the line's own rate. The port counts as open until `on_port_lost`.
    """

    def __init__(self, timing: LineTiming, now: float) -> None:
        self.timing = timing
        self.pending = PendingRequests()
        self.devices: dict[str, Device] = {}
        self._by_slave: dict[int, Device] = {}
        self._overhearing = Overhearing()
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
        before, self.devices = self.devices, {}
        fresh: list[Device] = []
        for spec in specs:
            device = before.get(spec.name)
            if device is None or spec.begins_anew(device.spec):
                device = Device(spec, rules, spec.slave)
                if self._lost:
                    device.cut_off()
                fresh.append(device)
                if (known := before.get(spec.name)) is not None and known.spec.profile == spec.profile:
                    device.gap = known.gap
            elif device.spec.interval != spec.interval:
                fresh.append(device)
            device.spec, device.rules = spec, rules
            device.gap.configured = spec.request_gap
            self.devices[spec.name] = device
        self._by_slave = {device.slave: device for device in self.devices.values()}
        self._overhearing.listen_to({device.slave: device.spec.codec for device in self.devices.values()})
        for device in fresh:
            self.pending.duplicates.forget(device.slave)
        for job in self._jobs.drop(lambda job: isinstance(job, Poll) and not self._wanted(job)):
            job.cut_off(now)
        self._requeue(fresh, now)

    def _requeue(self, fresh: list[Device], now: float) -> None:
        """Make the queue of polls anew, with new grids for `fresh`."""
        polled = [device for device in self.devices.values() if device.spec.enabled]
        if polled:
            wire_time = _wire_time(polled[0], self.timing)
            enabled = [device for device in fresh if device.spec.enabled]
            spread(enabled, polled=len(polled), wire_time=wire_time, now=now)
        kept = [poll for poll in self._polls.polls() if self._wanted(poll)]
        self._polls.clear()
        for poll in kept:
            self._polls.resume(poll, poll.due)
        for device in polled:
            if not device.polling:
                self._polls.enqueue(device)
        self._probing.review(polled, now)

    def _wanted(self, poll: Poll) -> bool:
        """Whether the reading of this poll is of any use (rule 5)."""
        device = poll.device
        useful = device.spec.enabled or poll.purpose is Purpose.REQUEST
        return useful and self.devices.get(device.name) is device

    # -- jobs

    def submit(self, job: Job, now: float) -> list[Reading]:
        """Take a job; it is asked as soon as its class and its share allow. While the port is lost it is cut off."""
        wanted = not isinstance(job, Poll) or self._wanted(job)
        lost = self._lost
        if wanted and lost is None:
            probes = job.purpose is Purpose.PROBE
            self._jobs.submit(job, now, self._probing.account if probes else None)
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
            for device in self.devices.values():
                device.response_times.forget()
        self.timing = timing

    def on_port_opened(self, now: float) -> None:
        """Note that the port is open: every device is due at once."""
        self._lost = None
        self.pending.duplicates.forget()
        for device in self.devices.values():
            device.reconnected()
        self._requeue(list(self.devices.values()), now)

    # -- who speaks next

    def next(self, now: float) -> Decision:
        """Decide who speaks next; the outcome of an `Ask` must come back through `on_outcome`."""
        for job in self._jobs.released(now):
            self._resume(job, now)
        while (chosen := self._choose(now)) is not None:
            decision = chosen.ask(now)
            if isinstance(decision, Ask):
                until = self._rests.until(chosen, decision, self._by_slave)
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

    def _begin(self, job: Job, ask: Ask, now: float) -> None:
        self._current = job, ask
        if isinstance(job, Poll) and not job.begun:
            job.device.polled_at = now

    def _choose(self, now: float) -> Job | None:
        job = self._jobs.choose(now)
        if job is not None:
            return job
        if self._probing.anyone_online:
            return self._choose_probe(now) or self._polls.choose(now, self._jobs.excluded)
        return self._polls.choose(now, self._jobs.excluded) or self._choose_probe(now)

    def _choose_probe(self, now: float) -> Poll | None:
        device = self._probing.choose(now, self._jobs.excluded)
        if device is None:
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
        """What the exchange on the line is for."""
        return self._current[0].purpose if self._current else Purpose.POLL

    # -- what came of it

    def on_outcome(self, outcome: Outcome, now: float) -> list[Reading]:
        """Take the outcome of the last `Ask`; return the reading of a poll or probe that is over by it."""
        if self._current is None:
            raise RuntimeError("an outcome without an Ask")
        (job, ask), self._current = self._current, None
        self.pending.on_outcome(outcome, ask.codec, ask.timeout, now)
        self._learn(outcome)
        widened = self._rests.learn(outcome, ask, self._by_slave, line_rate=self.timing.baudrate)
        self._spend(job, outcome, now)
        ignored = self._ignored(outcome)
        if isinstance(job, Poll) and self._wanted(job) and (widened or (ignored and self._benefits(job.device))):
            self._jobs.resume(job)
            return []
        following = job.on_outcome(outcome, now)
        if not isinstance(following, Continue):
            self._surcharge.released()
        if isinstance(job, Poll) and not self._wanted(job):
            job.cut_off(now)
            return []
        if isinstance(following, Requeue):
            self._resume(job, following.key)
            return []
        if isinstance(following, Continue):
            self._jobs.continue_slice(job)
            return []
        self._jobs.over(job)
        return [self._finish(job, now)] if isinstance(job, Poll) else []

    def on_answer(self, outcome: Outcome) -> list[AnsweredTwice]:
        """Take an outcome that is settled: a second answer may follow it, or none does any more."""
        device = self._by_slave.get(outcome.request.slave)
        if device is None or outcome.answer is None:
            return []
        barrier, request = device.spec.profile.barrier, outcome.request
        asked = (
            None if barrier is None else ReadRegisters(device.slave, barrier.register, barrier.count, barrier.function)
        )
        ended = self.pending.duplicates.answered(device.slave, outcome.ended, barrier=request == asked)
        return [AnsweredTwice(outcome.ended, device.name, device.slave, None)] if ended else []

    def on_strays(self, strays: Iterable[tuple[bytes, float]], outcome: Outcome | None = None) -> list[AnsweredTwice]:
        """Take what was heard and belongs to no exchange, or is left over by `outcome`, with the times of its pieces.

        A right frame of a slave that owes nothing is one answer too many.
        """
        events: list[AnsweredTwice] = []
        owing = outcome.request.slave if outcome is not None and outcome.answer is None else None
        for frame in self._overhearing.hear(strays):
            codec = self._by_slave[frame.slave].spec.codec
            if frame.request is not None:
                self.pending.asked_by_another(frame.request, codec, frame.at)
                continue
            size, exception = codec.size(len(frame.body)), bool(frame.body[1] & EXCEPTION_FLAG)
            owed = self.pending.overheard(frame.slave, size, exception=exception, now=frame.at)
            if owed or frame.slave == owing:
                continue
            twice = self.pending.duplicates.second(frame.slave, frame.at)
            if twice is not None:
                fault = Fault(FaultCode.DUPLICATE_ID, diagnosis.twice(twice), heard=codec.wrap(frame.body))
                events.append(AnsweredTwice(frame.at, self._by_slave[frame.slave].name, frame.slave, fault))
        return events

    def _ignored(self, outcome: Outcome) -> bool:
        """Whether the request may have been ignored only for the one before it (rule 4)."""
        before, self._silent = self._silent, None
        if outcome.fault is None or outcome.fault.code is not FaultCode.TIMEOUT:
            return False
        self._silent = outcome.request.slave
        return before not in (None, self._silent)

    def _benefits(self, device: Device) -> bool:
        """Whether a doubt about silence is worth another exchange at once (rule 4)."""
        if device.starting:
            return False
        return device.health is Health.UNHEARD or device.probe_exempt or not self._probing.anyone_online

    def _learn(self, outcome: Outcome) -> None:
        """Learn how long answers take, late ones included, whoever asked."""
        for late in outcome.late:
            device = self._by_slave.get(late.request.slave)
            # What is later than any time-out says nothing of the usual time, and may be an older answer's.
            if device is not None and late.ours and late.latency <= LEARNED_MOST:
                device.response_times.learn(late.latency)
        if outcome.turnaround is not None and outcome.answer is not None:
            device = self._by_slave.get(outcome.request.slave)
            if device is not None:
                device.response_times.learn(outcome.turnaround)

    def _spend(self, job: Job, outcome: Outcome, now: float) -> None:
        taken = outcome.ended - outcome.asked + self.timing.gap
        if isinstance(job, Poll) and job.purpose is Purpose.PROBE:
            self._probing.spend(job.device, taken, now)
        elif job.purpose is Purpose.CHANGE:
            self._jobs.spend(job, self._charge(job, outcome), now)
        else:
            self._jobs.spend(job, taken, now)

    def _charge(self, job: Job, outcome: Outcome) -> float:
        """Return what an exchange of a change costs, with what it costs the others."""
        others = [each for each in self.devices.values() if each.online and each.spec.enabled]
        intervals = [each.spec.interval for each in others if each.slave not in job.excludes]
        wire_time = _wire_time(others[0], self.timing) if others else 0.0
        ended = outcome.ended + self.timing.gap
        return self._surcharge.charge(job.share, outcome.asked, ended, intervals=intervals, wire_time=wire_time)

    def _finish(self, poll: Poll, now: float) -> Reading:
        device = poll.device
        before, doubtful = device.health, device.doubtful
        if poll.fault is None:
            device.answered()
        else:
            device.failed(poll.fault, now)
        if poll.purpose is not Purpose.REQUEST:
            device.polling = False
        if (before is not Health.ONLINE and device.online) or (doubtful and not device.doubtful):
            back_on_grid(device, now)
        if device.starting:
            self._hurry()
        if not device.polling:
            self._polls.enqueue(device)
        if (device.health, device.doubtful) != (before, doubtful):
            self._probing.review(self.devices.values(), now)
        elif device.doubtful:
            self._probing.plan(now)
        return poll.reading()

    def _hurry(self) -> None:
        """Wait for none of the devices long that are silent at the start, where they are many."""
        starting = [device for device in self.devices.values() if device.starting]
        for device in starting if len(starting) > START_PATIENT else ():
            device.hurried = True


def _wire_time(device: Device, timing: LineTiming) -> float:
    block = device.spec.profile.reads()[0]
    request = ReadRegisters(device.slave, block.address, block.count, block.function)
    codec = device.spec.codec
    return timing.exchange(len(codec.encode(request)), codec.answer_size(request))
