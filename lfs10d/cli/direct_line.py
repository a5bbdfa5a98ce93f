"""Direct access to the line for a verb: the daemon's line thread, as long as the verb runs."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterable
from queue import Empty, SimpleQueue
from typing import Self, TypeAlias

from lfs10d.errors import PortBusyError, PortLostError
from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.jobs.job import Job
from lfs10d.line.poller import Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.line.thread import LineThread
from lfs10d.modbus.bus import Bus, LineRules
from lfs10d.modbus.port import SerialPort
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.realtime import sharpen_timers
from lfs10d.reading import Event, FaultCode, PortChanged

SWITCH_INTERVAL = 1e-4
"""Seconds after which the interpreter switches threads, so that drawing does not delay the line."""
STOPS_WITHIN = 1.0
"""How long to wait for the thread's end, in s."""

_Message: TypeAlias = "list[Event] | BaseException"


class DirectLine:
    """Opens the port on entering, frees it on leaving. `framing_errors` of that time, if the driver counts."""

    def __init__(self, settings: PortSettings, rules: LineRules | None = None) -> None:
        self.path = settings.path
        self.framing_errors: int | None = None
        self._queue: SimpleQueue[_Message] = SimpleQueue()
        self._errors_before: int | None = None
        self._bus = Bus(SerialPort(settings), rules or LineRules(), time.monotonic)
        scheduler = Scheduler(self._bus.line_timing, time.monotonic())
        self._poller = Poller(self._bus, scheduler, self._take, time.monotonic)
        self._thread = LineThread(self._poller, prepare=_prepare, failed=self._queue.put)

    def __enter__(self) -> Self:
        """Start the thread, which opens the port or reports why it cannot."""
        sys.setswitchinterval(SWITCH_INTERVAL)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Free the port after the exchange under way, so that the next program does not receive its answer."""
        freed = threading.Event()
        self._poller.pause(freed.set)
        self._thread.wake()
        if self._thread.is_alive():
            freed.wait(STOPS_WITHIN)
        self._thread.stop()
        self._thread.join(STOPS_WITHIN)

    def submit(self, job: Job) -> None:
        """Submit a job to the line thread."""
        self._poller.submit(job)
        self._thread.wake()

    def poll(self, specs: Iterable[DeviceSpec], rules: PollRules) -> None:
        """Poll these devices from now on."""
        self._poller.replace(specs, rules)
        self._thread.wake()

    def events(self, within: float) -> list[Event]:
        """Return the next events, [] if none came within the time; raises PortError if the port cannot be used."""
        try:
            message = self._queue.get(timeout=within)
        except Empty:
            return []
        if isinstance(message, BaseException):
            raise message
        for event in message:
            if isinstance(event, PortChanged) and event.fault is not None and not event.freed:
                error = PortBusyError if event.fault.code is FaultCode.PORT_BUSY else PortLostError
                raise error(self.path, event.fault.message.removeprefix(f"{self.path}: "))
        return message

    def _take(self, events: list[Event]) -> None:
        """Queue events of the line thread; called in that thread."""
        now = self._bus.counters()
        if now is not None:
            if self._errors_before is None:
                self._errors_before = now.framing
            self.framing_errors = now.framing - self._errors_before
        self._queue.put(events)


def _prepare() -> None:
    sharpen_timers()
