"""The body of the line thread: the scheduler decides, the bus carries out, events report what happened.

`Poller.turn` is called with a time and says when to come back: by `LineThread` with the real clock, by tests with a
virtual one. Other threads only `post`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import astuple, replace
from math import inf
from typing import TypeAlias

from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.hand_over import HandOver
from lfs10d.line.jobs.job import Job
from lfs10d.line.jobs.poll import Poll
from lfs10d.line.scheduler import Rest, Scheduler
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.bus import Bus, LineRules, Wait
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.reading import Event, Exchanged, Fault, FaultCode, PortChanged, Purpose, UartCounted, UartCounters

COUNTERS_EVERY = 10.0
"""Seconds between two reads of the driver's counters."""

FREED = Fault(FaultCode.PORT_LOST, "the port is freed for another program")
"""The fault of devices while the line is paused."""

Sink: TypeAlias = "Callable[[list[Event]], None]"


class Poller:
    """Polls one line. `sink` takes the events, at most once per exchange; `clock` is the bus's.

    `hand_over.hold` lets several exchanges go together; 0 s without it.
    """

    def __init__(self, bus: Bus, scheduler: Scheduler, sink: Sink, clock: Callable[[], float]) -> None:
        self.bus = bus
        self.scheduler = scheduler
        self._sink = sink
        self._clock = clock
        self._posted: deque[Callable[[float], None]] = deque()
        self._events: list[Event] = []
        self._purpose = Purpose.POLL
        self._paused = False
        self.hand_over = HandOver()
        self._asked = 0.0
        self._count_at = clock()
        self._first_counters: UartCounters | None = None
        self._counted_before = self._counted = UartCounters(0, 0, 0, 0)

    # -- from any thread (the thread must be woken afterwards)

    def post(self, action: Callable[[float], None]) -> None:
        """Call `action(now)` between two exchanges."""
        self._posted.append(action)

    def submit(self, job: Job) -> None:
        """Submit `job` to the line."""
        self.post(lambda now: self._events.extend(self.scheduler.submit(job, now)))

    def wake(self, job: Job) -> None:
        """End the hold of `job`."""
        self.post(lambda now: self.scheduler.wake(job, now))

    def read(self, device: str, request: int) -> None:
        """Poll a device now for a request, whose number comes back with the reading; ignored for an unknown device."""
        self.post(lambda now: self._read(device, request, now))

    def _read(self, name: str, request: int, now: float) -> None:
        device = self.scheduler.devices.get(name)
        if device is not None:
            poll = Poll(device, self.scheduler.pending, due=now, purpose=Purpose.REQUEST, request=request)
            self._events += self.scheduler.submit(poll, now)

    def replace(self, specs: Iterable[DeviceSpec], rules: PollRules) -> None:
        """Poll these devices from now on."""
        devices = tuple(specs)
        self.post(lambda now: self._replace(devices, rules, now))

    def _replace(self, devices: tuple[DeviceSpec, ...], rules: PollRules, now: float) -> None:
        self._events += self.scheduler.second_answers.held.released()
        self.scheduler.replace(devices, rules, now)

    def reconfigure(self, settings: PortSettings, rules: LineRules) -> None:
        """Use other settings from now on; another path closes the port and opens the new one."""
        self.post(lambda now: self._reconfigure(settings, rules, now))

    def _reconfigure(self, settings: PortSettings, rules: LineRules, now: float) -> None:
        self.bus.reconfigure(settings, rules, now)
        self.scheduler.retime(self.bus.line_timing)

    def pause(self, freed: Callable[[], None]) -> None:
        """Close the port after the exchange under way, until `resume`; `freed()` is called in the line thread."""
        self.post(lambda now: self._pause(freed, now))

    def _pause(self, freed: Callable[[], None], now: float) -> None:
        if not self._paused:
            self._paused = True
            self.bus.close()
            self._port_changed(PortChanged(now, FREED, freed=True))
        freed()

    def resume(self) -> None:
        """Open the port again; the result is reported in any case. Nothing happens if it is not paused."""
        self.post(self._resume)

    def _resume(self, now: float) -> None:
        if self._paused:
            self._paused = False
            self.bus.retry(now)

    # -- in the line thread

    def turn(self, now: float, *, readable: bool = True) -> Wait:
        """Do what can be done now; return when to call again."""
        while True:
            while self._posted and self.bus.asked is None:
                self._posted.popleft()(now)
            wait = self._advance(now, readable=readable)
            if wait is not None:
                break
            readable = False
            now = self._clock()
        return self._hand_over(wait, now) if self._events else wait

    def _hand_over(self, wait: Wait, now: float) -> Wait:
        """Hand over the events, or end `wait` when they are due."""
        due = self.hand_over.due(self._events, now, self._asked)
        if due > now:
            return wait if wait.until <= due else replace(wait, until=due, not_before=min(wait.not_before, due))
        self.hand_over.handed_over()
        events, self._events = self._events, []
        self._sink(events)
        return wait

    def _advance(self, now: float, *, readable: bool) -> Wait | None:
        """Take one step; None where there may be more to do at once."""
        if not self.bus.open:
            return self._reopen(now)
        resting = None
        if self.bus.asked is None:
            decision = self.scheduler.next(now)
            if isinstance(decision, Rest):
                resting = decision
                self._asked = resting.until
            else:
                self._asked = now
                self._ask(decision)
        step = self.bus.step(now, readable=readable)
        no_longer_quiet = self._on_strays() if self.bus.strays else False
        if isinstance(step, Wait):
            if resting is None:
                return step
            if no_longer_quiet:
                return None
            held = self.scheduler.second_answers.held
            self._events += held.released(now)
            until = min(resting.until, held.next_at)
            return Wait(until, listen=True, hurried=not self.scheduler.patient(now))
        if isinstance(step, PortChanged):
            self._port_changed(step)
        else:
            self._settled(step, self._clock())
        return None

    def _on_strays(self) -> bool:
        """Take what was heard between two exchanges; whether the line need no longer be kept quiet by it."""
        second_answers = self.scheduler.second_answers
        quiet_until = second_answers.quiet.until
        strays, self.bus.strays = self.bus.strays, []
        self._events += second_answers.on_strays(strays)
        return second_answers.quiet.until < quiet_until

    def _reopen(self, now: float) -> Wait | None:
        opened = Wait(inf, listen=False) if self._paused else self.bus.reopen(now)
        if isinstance(opened, Wait):
            return opened
        self._port_changed(opened)
        return None

    def _ask(self, ask: Ask) -> None:
        self._purpose = self.scheduler.purpose
        self.bus.ask(ask, self.scheduler.pending.by_slave, hurried=not self.scheduler.patient(self._asked))

    def _settled(self, outcome: Outcome, now: float) -> None:
        self.hand_over.on_exchange(outcome.ended - outcome.asked)
        second_answers = self.scheduler.second_answers
        told = (
            second_answers.on_strays(outcome.strays, outcome) if outcome.answer is not None and outcome.strays else []
        )
        readings = self.scheduler.on_outcome(outcome, now)
        stray, self.bus.unsolicited = self.bus.unsolicited, 0
        self._events.append(
            Exchanged(
                at=outcome.ended,
                asked=outcome.asked,
                began=outcome.began,
                gap=outcome.gap,
                slave=outcome.request.slave,
                purpose=self._purpose,
                fault=None if outcome.fault is None else outcome.fault.code,
                sent=outcome.sent,
                heard=outcome.heard,
                unsolicited=outcome.unsolicited + stray,
                late=sum(late.ours for late in outcome.late) if outcome.late else 0,
            )
        )
        self._events += second_answers.prove(outcome, readings)
        self._events += second_answers.on_answer(outcome)
        self._events += told
        if outcome.answer is None and outcome.strays:
            self._events += second_answers.on_strays(outcome.strays, outcome)
        if second_answers.held.entries:
            self._events += second_answers.held.released(outcome.ended)
        if now >= self._count_at:
            self._count(now)

    def _port_changed(self, changed: PortChanged) -> None:
        self._events.append(changed)
        if changed.fault is None:
            self._first_counters, self._counted_before = None, self._counted  # another adapter begins at 0
            self._count_at = changed.at
            self.scheduler.on_port_opened(changed.at)
        else:
            self._events += self.scheduler.second_answers.held.released()
            self._events += self.scheduler.on_port_lost(changed.fault, changed.at)

    def _count(self, now: float) -> None:
        """Read the driver's counters; it is time."""
        self._count_at = now + COUNTERS_EVERY
        counters = self.bus.counters()
        if counters is None:
            return
        first = self._first_counters = self._first_counters or counters
        each = zip(astuple(self._counted_before), astuple(counters), astuple(first), strict=True)
        self._counted = UartCounters(*(before + count - start for before, count, start in each))
        self._events.append(UartCounted(now, self._counted))
