"""Reports `wrong_rate` while no sensor answers at the line's rate but some do at another."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from functools import partial

from lfs10d.config.effective import Effective
from lfs10d.line.device import Device
from lfs10d.reading import Purpose
from lfs10d.reconfiguration.procedure_run import ProcedureRun
from lfs10d.reconfiguration.procedures.find_baudrate import find_other_rates, message
from lfs10d.reconfiguration.searches import Searches

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
        self._devices = devices
        self._report = report
        self._reported: str | None = None
        self._searches: Searches[int] = Searches(new_run)

    def begin(self) -> None:
        """Watch from now on, at the line's rate as it is; the port is open."""
        rate = self._running().config.line.baudrate
        if rate in self._searches:
            return
        self.stop()
        self._searches.begin(rate, "rate watch", partial(self._watch, rate))
        self._report_change(None)

    def stop(self) -> None:
        """Watch no more."""
        self._searches.end_all()

    async def _watch(self, rate: int, run: ProcedureRun) -> None:
        steps = find_other_rates(self._devices, run.clock, rate)
        async for found in run.carry_out(steps, line_rate=rate, share=1.0, purpose=Purpose.PROBE):
            if isinstance(found, dict):
                now = self._running()
                polled = sum(slave.enabled for slave in now.config.slaves)
                self._report_change(message(found, rate, polled, filed=now.file_values.baudrate) if found else None)

    def _report_change(self, text: str | None) -> None:
        if text != self._reported:
            self._reported = text
            self._report(text)
            if text is not None:
                log.warning("%s", text)
