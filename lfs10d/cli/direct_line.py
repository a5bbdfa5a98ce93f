"""A line of the verb's own: the daemon's line thread for as long as one verb needs it."""

from __future__ import annotations

import sys
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
from lfs10d.reading import Event, FaultCode, PortChanged, UartCounters

SWITCH_INTERVAL = 1e-4
"""Seconds the interpreter lets one thread run on, so that drawing does not delay the line."""
STOPS_WITHIN = 1.0
"""How long the thread is waited for at the end, in s."""

_Told: TypeAlias = "list[Event] | BaseException"


class DirectLine:
    """Opens the port on entering, frees it on leaving. `uart` is what the driver counted meanwhile, if it counts."""

    def __init__(self, settings: PortSettings) -> None:
        self.path = settings.path
        self.uart: UartCounters | None = None
        self._told: SimpleQueue[_Told] = SimpleQueue()
        self._first: UartCounters | None = None
        self._bus = Bus(SerialPort(settings), LineRules(), time.monotonic)
        scheduler = Scheduler(self._bus.line_timing, time.monotonic())
        self._poller = Poller(self._bus, scheduler, self._take, time.monotonic)
        self._thread = LineThread(self._poller, prepare=_prepare, failed=self._told.put)

    def __enter__(self) -> Self:
        """Start the thread; it opens the port, and tells if it cannot."""
        sys.setswitchinterval(SWITCH_INTERVAL)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Free the port."""
        self._thread.stop()
        self._thread.join(STOPS_WITHIN)

    def submit(self, job: Job) -> None:
        """Have a job done."""
        self._poller.submit(job)
        self._thread.wake()

    def poll(self, specs: Iterable[DeviceSpec], rules: PollRules) -> None:
        """Have these devices polled."""
        self._poller.replace(specs, rules)
        self._thread.wake()

    def events(self, within: float) -> list[Event]:
        """Return what happened next, [] if nothing did within so many s; PortError if the port cannot be used."""
        try:
            told = self._told.get(timeout=within)
        except Empty:
            return []
        if isinstance(told, BaseException):
            raise told
        for event in told:
            if isinstance(event, PortChanged) and event.fault is not None:
                error = PortBusyError if event.fault.code is FaultCode.PORT_BUSY else PortLostError
                raise error(self.path, event.fault.message.removeprefix(f"{self.path}: "))
        return told

    def _take(self, events: list[Event]) -> None:
        """Take what the line thread tells, in that thread."""
        now = self._bus.counters()
        if now is not None:
            first = self._first = self._first or now
            self.uart = UartCounters(
                now.framing - first.framing,
                now.parity - first.parity,
                now.overrun - first.overrun,
                now.breaks - first.breaks,
            )
        self._told.put(events)


def _prepare() -> None:
    sharpen_timers()
