"""A scan on request: it holds the one place of scans and changes, tells how far it is, and can be cancelled.

Used in the thread of the asyncio loop; the scan itself runs in the line's.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Mapping
from typing import Final

from lfs10d.line.jobs.job import Job
from lfs10d.line.jobs.scan import Scan
from lfs10d.line.jobs.scan_plan import ScanPlan

SCANNING: Final = "scanning"
"""The activity of the line while it lasts."""
LOOK_EVERY = 0.5
"""How often it is looked at, in s."""
STEP = 10.0
"""Its progress is told whenever so many percent more are done, and at its beginning and end."""
LAST_STEP = 99.0
"""Percent that are told at most before the end: at the end of each round some ids are asked again."""


class Scanner:
    """`submit` has a job done on the line, `act` tells what the line is busy with (None: as usual), `tell` an event."""

    def __init__(
        self,
        *,
        submit: Callable[[Job], None],
        act: Callable[[str | None], None],
        tell: Callable[[str, Mapping[str, object]], None],
    ) -> None:
        self._submit = submit
        self._act = act
        self._tell = tell
        self._scan: Scan | None = None
        self._over: asyncio.Future[None] | None = None

    async def scan(self, search: ScanPlan) -> Scan:
        """Scan, one at a time; return the scan when it is over, however it ended. Cancelling it ends it early."""
        loop = asyncio.get_running_loop()
        over: asyncio.Future[None] = loop.create_future()

        def ended(_: Scan) -> None:
            with contextlib.suppress(RuntimeError):  # the loop is closed: nobody waits any more
                loop.call_soon_threadsafe(_settle, over)

        scan = Scan(search, ended)
        self._scan, self._over = scan, over
        self._act(SCANNING)
        try:
            self._submit(scan)
            await self._follow(scan, over)
        except asyncio.CancelledError:  # the daemon is ending: what was found is told all the same
            scan.cancel()
        finally:
            self._scan = self._over = None
            self._act(None)
        return scan

    def cancel(self) -> bool:
        """End the scan; whether there was one. Its last exchange may still be on the line."""
        if self._scan is None or self._over is None:
            return False
        self._scan.cancel()
        _settle(self._over)
        return True

    async def _follow(self, scan: Scan, over: asyncio.Future[None]) -> None:
        """Tell how far it is until it is over, and of every id that seems to have two devices."""
        duplicates: set[tuple[int, int]] = set()
        self._tell_progress(scan, told := 0.0)
        while not over.done():
            await asyncio.wait([over], timeout=LOOK_EVERY)
            self._tell_duplicates(scan, duplicates)
            done = min(scan.progress.percent, LAST_STEP)
            if not over.done() and done >= told + STEP:
                self._tell_progress(scan, told := done)
        if scan.complete:
            self._tell_progress(scan, 100.0)

    def _tell_progress(self, scan: Scan, percent: float) -> None:
        progress = scan.progress
        facts = {
            "percent": round(percent, 1),
            "remaining_s": 0.0 if scan.complete else round(max(0.0, progress.remaining), 1),
            "asked": progress.asked,
            "total": progress.total,
            "slave": progress.slave,
            "baudrate": progress.baudrate,
            "found": len(scan.found),
        }
        self._tell("scan_progress", facts)

    def _tell_duplicates(self, scan: Scan, told: set[tuple[int, int]]) -> None:
        for finding in scan.found:
            place = finding.slave, finding.baudrate
            if finding.duplicate and place not in told:
                told.add(place)
                self._tell("duplicate_id", {"slave": finding.slave, "baudrate": finding.baudrate})


def _settle(over: asyncio.Future[None]) -> None:
    if not over.done():
        over.set_result(None)
