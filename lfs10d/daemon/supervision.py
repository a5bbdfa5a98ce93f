"""Once a second: notifies the service manager, feeds the watchdog, writes `status.json`."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Mapping

from lfs10d.daemon.status_file import StatusFile
from lfs10d.daemon.watchdog import progressing, stacks
from lfs10d.system.systemd import Notifier

log = logging.getLogger(__name__)

EVERY = 1.0
"""s between two checks."""


class Supervision:
    """Supervises the daemon from its own loop.

    `declared()` is the time by which the line thread promised its next turn, `snapshot()` what `watch` shows,
    `summary()` one line for `systemctl status`.
    """

    def __init__(
        self,
        notifier: Notifier,
        file: StatusFile | None,
        *,
        declared: Callable[[], float],
        snapshot: Callable[[], Mapping[str, object]],
        summary: Callable[[], str],
    ) -> None:
        self._notifier = notifier
        self._file = file
        self._declared = declared
        self._snapshot = snapshot
        self._summary = summary
        self._told = ""
        self._wedged = False
        self._writable = True

    async def run(self) -> None:
        """Check once a second (more often if the watchdog is short), until cancelled."""
        every = EVERY if self._notifier.watchdog is None else min(EVERY, self._notifier.watchdog / 3)
        try:
            while True:
                self._look()
                await asyncio.sleep(every)
        finally:
            if self._file is not None:
                self._file.remove()

    def _look(self) -> None:
        if progressing(self._declared(), time.monotonic()):
            self._notifier.feed()
            self._wedged = False
        elif not self._wedged:
            self._wedged = True
            log.error("the line's thread makes no progress; the watchdog is no longer fed")
            for line in stacks(threading.enumerate()):
                log.error("%s", line)
        summary = self._summary()
        if summary != self._told:
            self._told = summary
            self._notifier.status(summary)
        if self._file is not None and self._file.show(self._snapshot()) is not self._writable:
            self._writable = not self._writable
            if not self._writable:
                log.warning("%s cannot be written: `lfs10d watch` needs the broker", self._file.path)
