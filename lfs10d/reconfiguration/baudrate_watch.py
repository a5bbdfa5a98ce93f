"""Reports `wrong_rate` while no sensor answers at the line's rate but some do at another."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable

from lfs10d.config.effective import Effective
from lfs10d.line.device import Device
from lfs10d.line.jobs.procedure import Finished, ProcedureClock
from lfs10d.reading import Purpose
from lfs10d.reconfiguration.procedure_run import ProcedureRun
from lfs10d.reconfiguration.procedures.find_baudrate import find_other_rates, message
from lfs10d.system.tasks import BackgroundTasks

log = logging.getLogger(__name__)


class BaudrateWatch:
    """Used in the thread of the asyncio loop.

    `report(message)` raises the line's error, `report(None)` clears it; `devices()` are those of the line's thread.
    """

    def __init__(
        self,
        *,
        running: Callable[[], Effective],
        new_run: Callable[[], ProcedureRun],
        devices: Callable[[], Iterable[Device]],
        report: Callable[[str | None], None],
    ) -> None:
        self._running = running
        self._new_run = new_run
        self._devices = devices
        self._report = report
        self._tasks = BackgroundTasks()
        self._reported: str | None = None
        self._task: tuple[int, ProcedureRun, asyncio.Task[None]] | None = None

    def begin(self) -> None:
        """Watch from now on, at the line's rate as it is; the port is open."""
        rate = self._running().config.line.baudrate
        if self._task is not None and self._task[0] == rate and not self._task[2].done():
            return
        self.stop()
        run = self._new_run()
        self._task = rate, run, self._tasks.start("rate watch", self._watch(rate, run))
        self._report_change(None)

    def stop(self) -> None:
        """Watch no more."""
        if self._task is not None:
            _, run, task = self._task
            run.stop()
            task.cancel()
            self._task = None

    async def _watch(self, rate: int, run: ProcedureRun) -> None:
        clock = ProcedureClock()
        run.begin(find_other_rates(self._devices, clock, rate), clock, line_rate=rate, share=1.0, purpose=Purpose.PROBE)
        while not isinstance(found := await run.next_await(), Finished):
            if isinstance(found, dict):
                now = self._running()
                polled = sum(slave.enabled for slave in now.config.slaves)
                self._report_change(message(found, rate, polled, filed=now.file_values.baudrate) if found else None)
            run.resume()

    def _report_change(self, text: str | None) -> None:
        if text != self._reported:
            self._reported = text
            self._report(text)
            if text is not None:
                log.warning("%s", text)
