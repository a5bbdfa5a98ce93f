"""A scan on request: publishes its progress, and can be cancelled.

Used in the thread of the asyncio loop; the scan itself runs in the line's.
"""

from __future__ import annotations

import asyncio
import contextlib
from typing import Final

from lfs10d.line.jobs.scan import Scan
from lfs10d.line.jobs.scan_plan import ScanPlan
from lfs10d.line.line import Line
from lfs10d.mqtt.publisher import Publisher

SCANNING: Final = "scanning"
"""The line's activity during a scan."""
LOOK_EVERY = 0.5
"""Seconds between two checks of its progress."""
STEP = 10.0
"""Progress is published at the beginning, at the end, and at each step of this many percent."""
LAST_STEP = 99.0
"""Highest percentage published before the end: after each round some ids are asked again."""


class Scanner:
    """One scan at a time."""

    def __init__(self, line: Line, publisher: Publisher) -> None:
        self._line = line
        self._publisher = publisher
        self._scan: Scan | None = None
        self._over = asyncio.Event()
        """Set once the scan is over, or cancelled."""

    async def scan(self, plan: ScanPlan) -> Scan:
        """Scan, one at a time; return the scan when it is over. Cancelling the task ends it early."""
        loop, over = asyncio.get_running_loop(), asyncio.Event()

        def ended(_: Scan) -> None:
            with contextlib.suppress(RuntimeError):  # the loop is closed: nothing waits any more
                loop.call_soon_threadsafe(over.set)

        scan = Scan(plan, ended)
        self._scan, self._over = scan, over
        self._publisher.act(SCANNING)
        try:
            self._line.submit(scan)
            await self._follow(scan, over)
        except asyncio.CancelledError:  # the daemon is ending: what was found is returned all the same
            scan.cancel()
        finally:
            self._scan = None
            self._publisher.act(None)
        return scan

    def cancel(self) -> bool:
        """End the scan and return whether there was one; its last exchange may still be on the line."""
        if self._scan is None:
            return False
        self._scan.cancel()
        self._over.set()
        return True

    async def _follow(self, scan: Scan, over: asyncio.Event) -> None:
        """Publish the progress of a scan until its end, and each id that seems to have two devices."""
        duplicates: set[tuple[int, int]] = set()
        self._publish_progress(scan, last := 0.0)
        while not over.is_set():
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(over.wait(), LOOK_EVERY)
            self._publish_duplicates(scan, duplicates)
            done = min(scan.progress.percent, LAST_STEP)
            if not over.is_set() and done >= last + STEP:
                self._publish_progress(scan, last := done)
        if scan.complete:
            self._publish_progress(scan, 100.0)

    def _publish_progress(self, scan: Scan, percent: float) -> None:
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
        self._publisher.announce("scan_progress", facts)

    def _publish_duplicates(self, scan: Scan, published: set[tuple[int, int]]) -> None:
        for finding in scan.found:
            place = finding.slave, finding.baudrate
            if finding.duplicate and place not in published:
                published.add(place)
                self._publisher.announce("duplicate_id", {"slave": finding.slave, "baudrate": finding.baudrate})
