"""The line as the daemon holds it: port, bus, scheduler and poller, and the thread that owns them.

What happens in the thread is handed over to the asyncio loop by one `call_soon_threadsafe` per exchange, or for
several together (`mqtt.hold`).
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections import deque
from collections.abc import Mapping
from functools import partial
from typing import Protocol

from lfs10d.config.models import Config, LineConfig
from lfs10d.line.budget import timing_of
from lfs10d.line.device import Device
from lfs10d.line.jobs.job import Job
from lfs10d.line.jobs.procedure import Procedure
from lfs10d.line.poller import Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.line.settings import device_specs, line_rules, poll_rules, port_settings
from lfs10d.line.thread import WAKING, WAKING_REALTIME, LineThread
from lfs10d.modbus.bus import Bus
from lfs10d.modbus.echo import Echo
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.port import SerialPort
from lfs10d.modbus.realtime import sharpen_timers, take_precedence, yield_precedence
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Event
from lfs10d.system.threads import ThreadFuture

log = logging.getLogger(__name__)


class LineEvents(Protocol):
    """What the line reports to, in the thread of the asyncio loop."""

    def on_events(self, events: list[Event]) -> None:
        """Take the events of an exchange, in order."""

    def on_failure(self, error: BaseException) -> None:
        """Take the internal error that ended the line's thread."""


class Line:
    """Built in the thread of the asyncio loop. Its devices are given by `take`, before the start too."""

    def __init__(self, line: LineConfig) -> None:
        self.port = SerialPort(port_settings(line))
        bus = Bus(self.port, line_rules(line), time.monotonic)
        scheduler = Scheduler(timing_of(line), time.monotonic())
        self.poller = Poller(bus, scheduler, self._take_over, time.monotonic)
        self._realtime = line.realtime
        self._events: LineEvents
        """Given at the start."""
        self._loop = asyncio.get_running_loop()
        self._inbox: deque[list[Event]] = deque()
        self._thread = LineThread(self.poller, prepare=self._prepare, failed=self._tell_failed)

    def start(self, events: LineEvents) -> None:
        """Open the port and poll."""
        self._events = events
        self._thread.start()

    async def stop(self, within: float) -> None:
        """Close the port and end the thread; after `within` s it is no longer waited for."""
        self._thread.stop()
        await asyncio.to_thread(self._thread.join, within)

    def wake(self) -> None:
        """Wake the thread, so that it looks at what was given to the poller."""
        self._thread.wake()

    @property
    def declared(self) -> float:
        """The monotonic time by which the thread promised its next turn."""
        return self._thread.declared

    def devices(self) -> tuple[Device, ...]:
        """Return the devices as the line's thread has them."""
        return tuple(self.poller.scheduler.devices.values())

    def read(self, device: str, request: int) -> None:
        """Poll a device now for a request, whose number comes back with the reading."""
        self.poller.read(device, request)
        self.wake()

    def submit(self, job: Job) -> None:
        """Submit a job; its callbacks run in the line's thread."""
        self.poller.submit(job)
        self.wake()

    def resume_procedure(self, procedure: Procedure, result: object) -> None:
        """Give a procedure the result that it awaits."""

        def tell(now: float) -> None:
            procedure.resume(result)
            self.poller.scheduler.wake(procedure, now)

        self.poller.post(tell)
        self.wake()

    def hand_over_at_once(self, until: float) -> None:
        """Hand over each exchange by itself until that monotonic time: the frames are being watched."""
        self.poller.hand_over.at_once_until = until

    async def pause(self) -> None:
        """Close the port until `resume`; return when it is free."""
        freed: ThreadFuture[None] = ThreadFuture()
        self.poller.pause(partial(freed.set_result, None))
        self.wake()
        await freed

    def resume(self) -> None:
        """Open the port again, if it is paused."""
        self.poller.resume()
        self.wake()

    @property
    def pending(self) -> PendingRequests:
        """Which requests may still be answered; for jobs, in the line's thread."""
        return self.poller.scheduler.pending

    def echo_known(self) -> bool:
        """Whether it is known how the adapter echoes: before that nothing is written."""
        return self.poller.bus.echo is not Echo.UNKNOWN

    def take(
        self, config: Config, profiles: Mapping[str, Profile], *, line: bool = False, realtime: bool = False
    ) -> None:
        """Poll by another configuration from now on; `line` and `realtime` tell whether those changed."""
        if line:
            self.poller.reconfigure(port_settings(config.line), line_rules(config.line))
        if realtime:
            wanted = self._realtime = config.line.realtime
            self.poller.post(lambda _: self._precede(wanted=wanted))
        self.poller.replace(device_specs(config, profiles), poll_rules(config.poll))
        self.poller.post(lambda _: self._hold(config.mqtt.hold))
        self.wake()

    # -- in the line's thread

    def _prepare(self) -> None:
        """Make the thread wake up on time; runs before its first turn."""
        if not sharpen_timers():
            log.debug("the timer slack of the line's thread cannot be set: gaps are 50 us longer than need be")
        if self._realtime:
            self._precede(wanted=True)

    def _precede(self, *, wanted: bool) -> None:
        """Put the thread under SCHED_FIFO and wake it earlier, or make it an ordinary thread again."""
        self._thread.waking = WAKING
        if not wanted:
            yield_precedence()
        elif (refusal := take_precedence()) is not None:
            log.warning("%s", refusal)
        else:
            self._thread.waking = WAKING_REALTIME

    def _hold(self, hold: float) -> None:
        self.poller.hand_over.hold = hold

    def _take_over(self, events: list[Event]) -> None:
        self._inbox.append(events)
        try:
            self._loop.call_soon_threadsafe(self._empty)
        except RuntimeError:  # the loop is closed: we are ending
            log.debug("the asyncio loop is closed: the last events of the line are not reported")

    def _tell_failed(self, error: BaseException) -> None:
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._events.on_failure, error)

    # -- in the loop again

    def _empty(self) -> None:
        while self._inbox:
            self._events.on_events(self._inbox.popleft())
