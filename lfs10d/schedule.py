"""Who speaks next on the line. Pure: it decides, the bus obeys, one `Ask` at a time; so no lock guards anything.

Rules
-----
1. In this order: jobs without a share (requests); jobs within their share of the line (scans, changes) and probes
   (`lfs10d.probing`); polls (`lfs10d.pollqueue`). While no device answers, polls go before probes.
2. A slave id that a job excludes is asked by nobody else while the job runs.
3. When the port is lost every device is offline and gets one reading; nothing is due until it is back, then every
   device is due at once.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, TypeAlias

from lfs10d.jobs.job import Ask, Hold, Job, Later
from lfs10d.jobs.poll import Poll
from lfs10d.modbus.frames import ReadRegisters
from lfs10d.modbus.unanswered import Unanswered
from lfs10d.pollqueue import PollQueue, back_on_grid, spread
from lfs10d.probing import Probing
from lfs10d.reading import Errand, Fault, Reading
from lfs10d.roster import Device, DeviceSpec, Health, PollRules
from lfs10d.share import Share

if TYPE_CHECKING:
    from collections.abc import Iterable

    from lfs10d.modbus.exchange import Outcome
    from lfs10d.modbus.timing import LineTiming


@dataclass(frozen=True, slots=True)
class Rest:
    """Nobody wants the line before `until` (inf: before somebody submits something)."""

    until: float


Decision: TypeAlias = Ask | Rest


class Schedule:
    """The devices of one line and the jobs on it; `now` is the line's clock at the beginning."""

    def __init__(self, timing: LineTiming, now: float) -> None:
        self.timing = timing
        self.unanswered = Unanswered()
        self.devices: dict[str, Device] = {}
        self._by_slave: dict[int, Device] = {}
        self._polls = PollQueue(self.unanswered)
        self._probing = Probing(now)
        self._jobs: deque[Job] = deque()
        self._held: list[tuple[float, Job]] = []
        self._shares: dict[Job, Share] = {}
        self._excluded: frozenset[int] = frozenset()
        self._current: tuple[Job, Ask] | None = None
        self._open = True

    # -- what is to be polled

    def replace(self, specs: Iterable[DeviceSpec], rules: PollRules, now: float) -> None:
        """Poll these devices from `now` on; those that stay keep their health, their grid and their turn.

        One that is enabled again, or whose slave id, profile or codec changed, is a new one on the line.
        """
        before, self.devices = self.devices, {}
        fresh: list[Device] = []
        for spec in specs:
            device = before.get(spec.name)
            if device is None or _another(device.spec, spec):
                device = Device(spec, rules, spec.slave)
                if not self._open:
                    device.cut_off()
                fresh.append(device)
            elif device.spec.interval != spec.interval:
                fresh.append(device)
            device.spec, device.rules = spec, rules
            self.devices[spec.name] = device
        self._by_slave = {device.slave: device for device in self.devices.values()}
        self._requeue(fresh, now)

    def _requeue(self, fresh: list[Device], now: float) -> None:
        """Make the queue anew; polls in progress of devices that are gone are dropped."""
        polled = [device for device in self.devices.values() if device.spec.enabled]
        if polled:
            wire_time = _wire_time(polled[0], self.timing)
            enabled = [device for device in fresh if device.spec.enabled]
            spread(enabled, polled=len(polled), wire_time=wire_time, now=now)
        kept = [poll for poll in self._polls.polls() if self._wanted(poll)]
        self._polls.clear()
        for poll in kept:
            self._polls.resume(poll, poll.due)
        self._jobs = deque(job for job in self._jobs if not isinstance(job, Poll) or self._wanted(job))
        self._held = [(until, job) for until, job in self._held if not isinstance(job, Poll) or self._wanted(job)]
        for device in self.devices.values():
            if not device.polling:
                self._polls.enqueue(device)
        self._probing.review(self.devices.values(), now)

    def _wanted(self, poll: Poll) -> bool:
        """Whether somebody still waits for this poll: a request, or its device is still polled."""
        stands = self.devices.get(poll.device.name) is poll.device and poll.device.spec.enabled
        return stands or poll.errand is Errand.REQUEST

    # -- jobs

    def submit(self, job: Job, now: float) -> None:
        """Take a job; it is asked as soon as its class and its share allow."""
        if job.share < 1:
            self._shares[job] = Share(job.share, credit=0.0, now=now)
        self._jobs.append(job)
        self._excluded |= job.excludes

    def wake(self, job: Job, now: float) -> None:
        """End the `Hold` of `job`."""
        for entry in self._held:
            if entry[1] is job:
                self._held.remove(entry)
                self._resume(job, now)
                return

    def _over(self, job: Job) -> None:
        self._shares.pop(job, None)
        if job.excludes:
            running = [*self._jobs, *(held for _, held in self._held)]
            self._excluded = frozenset().union(*(other.excludes for other in running))

    # -- the port

    def port_lost(self, fault: Fault, now: float) -> list[Reading]:
        """Note that the port is lost: one reading per polled device; every job is over."""
        jobs = [*self._jobs, *(job for _, job in self._held)]
        if self._current is not None:
            jobs.append(self._current[0])
        for job in jobs:
            job.cut_off(now)
        self._jobs.clear()
        self._held.clear()
        self._shares.clear()
        self._excluded = frozenset()
        self._current = None
        self._open = False
        self._polls.clear()
        self._probing.stop()
        for device in self.devices.values():
            device.cut_off()
        return [_reading(device, now, fault) for device in self.devices.values() if device.spec.enabled]

    def port_opened(self, now: float) -> None:
        """Note that the port is open: every device is due at once."""
        self._open = True
        for device in self.devices.values():
            device.reconnected()
            self.unanswered.forget(device.slave)
        self._requeue(list(self.devices.values()), now)

    # -- who speaks next

    def next(self, now: float) -> Decision:
        """Decide who speaks next; the outcome of an `Ask` must come back through `settled`."""
        for entry in [entry for entry in self._held if entry[0] <= now]:
            self._held.remove(entry)
            self._resume(entry[1], now)
        while True:
            job = self._choose(now)
            if job is None:
                return Rest(self._next_wish(now))
            decision = job.ask(now)
            if isinstance(decision, Ask):
                self._current = job, decision
                return decision
            if isinstance(decision, Hold):
                self._held.append((inf if decision.until is None else decision.until, job))
            else:
                self._over(job)

    def _choose(self, now: float) -> Job | None:
        for _ in range(len(self._jobs)):
            job = self._jobs.popleft()
            if job not in self._shares or self._shares[job].allows(now):
                return job
            self._jobs.append(job)
        if self._probing.anyone_online:
            return self._choose_probe(now) or self._polls.choose(now, self._excluded)
        return self._polls.choose(now, self._excluded) or self._choose_probe(now)

    def _choose_probe(self, now: float) -> Poll | None:
        device = self._probing.choose(now, self._excluded)
        if device is None:
            return None
        device.polling = True
        device.last_asked = now
        return Poll(device, self.unanswered, due=now, errand=Errand.PROBE)

    def _resume(self, job: Job, key: float) -> None:
        if isinstance(job, Poll) and job.errand is Errand.POLL:
            self._polls.resume(job, key)
        elif isinstance(job, Poll):
            self._jobs.appendleft(job)
        else:
            self._jobs.append(job)

    def _next_wish(self, now: float) -> float:
        wishes = [self._probing.next_at, self._polls.next_due()]
        wishes += [until for until, _ in self._held]
        wishes += [self._shares[job].ready_at(now) for job in self._jobs]
        return min(wishes)

    @property
    def errand(self) -> Errand:
        """What the exchange on the line is for."""
        return self._current[0].errand if self._current else Errand.POLL

    # -- what came of it

    def settled(self, outcome: Outcome, now: float) -> list[Reading]:
        """Take the outcome of the last `Ask`; return the reading of a poll or probe that is over by it."""
        if self._current is None:
            raise RuntimeError("an outcome without an Ask")
        (job, ask), self._current = self._current, None
        self.unanswered.settled(outcome, ask.codec, ask.timeout)
        self._learn(outcome)
        self._spend(job, outcome, now)
        following = job.heard(outcome, now)
        if isinstance(job, Poll) and not self._wanted(job):
            return []
        if isinstance(following, Later):
            self._resume(job, following.key)
            return []
        self._over(job)
        return [self._finish(job, now)] if isinstance(job, Poll) else []

    def _learn(self, outcome: Outcome) -> None:
        """Learn how long answers take, late ones included, whoever asked."""
        for late in outcome.late:
            if late.request.slave in self._by_slave:
                self._by_slave[late.request.slave].turnarounds.learn(late.latency)
        if outcome.turnaround is not None and outcome.answer is not None:
            device = self._by_slave.get(outcome.request.slave)
            if device is not None:
                device.turnarounds.learn(outcome.turnaround)

    def _spend(self, job: Job, outcome: Outcome, now: float) -> None:
        taken = outcome.ended - outcome.asked + self.timing.gap
        if job in self._shares:
            self._shares[job].spend(taken, now)
        elif isinstance(job, Poll) and job.errand is Errand.PROBE:
            self._probing.spend(job.device, taken, now)

    def _finish(self, poll: Poll, now: float) -> Reading:
        device = poll.device
        before = device.health
        if poll.fault is None:
            device.answered()
        else:
            device.failed(poll.fault, now)
        if poll.errand is not Errand.REQUEST:
            device.polling = False
        if before is Health.OFFLINE and device.online:
            back_on_grid(device, now)
        if not device.polling:
            self._polls.enqueue(device)
        if device.health is not before:
            self._probing.review(self.devices.values(), now)
        elif device.health is Health.OFFLINE:
            self._probing.plan(now)
        return _reading(device, poll.at, poll.fault, poll)


def _another(old: DeviceSpec, new: DeviceSpec) -> bool:
    reborn = new.enabled and not old.enabled
    return reborn or (old.slave, old.profile, old.codec) != (new.slave, new.profile, new.codec)


def _wire_time(device: Device, timing: LineTiming) -> float:
    block = device.spec.profile.reads()[0]
    request = ReadRegisters(device.slave, block.address, block.count, block.function)
    codec = device.spec.codec
    return timing.exchange(len(codec.encode(request)), codec.answer_size(request))


def _reading(device: Device, at: float, fault: Fault | None, poll: Poll | None = None) -> Reading:
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
    )
