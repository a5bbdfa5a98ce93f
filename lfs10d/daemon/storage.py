"""Watches whether files can be written: the state directory, the backlog in it, the changes by request."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from pathlib import Path

from lfs10d.daemon.boot import Boot, keep
from lfs10d.daemon.state_directory import prepare
from lfs10d.errors import StateError
from lfs10d.reading import FaultCode, LineFaultCode
from lfs10d.system.disk import Disk

log = logging.getLogger(__name__)


LOOK_EVERY = 5.0
"""Seconds between two checks while files cannot be written."""


class Storage:
    """Logs failures to write, and raises them as an error of the line by `set_line_error`; None clears it.

    When the trouble is over, the id of this life (`boot`) is put on the disk if it is not there yet.
    """

    def __init__(
        self, directory: Path, boot: Boot, set_line_error: Callable[[LineFaultCode, str | None], None]
    ) -> None:
        self._directory = directory
        self._boot = boot
        self._set_line_error = set_line_error
        self._backlog: str | None = None
        """Why the backlog cannot be kept on disk; None if it can."""
        self._reported: str | None = None

    def look(self) -> None:
        """Check whether files can be written."""
        trouble = self._backlog
        try:
            prepare(self._directory)
        except StateError as error:
            trouble = str(error)
        before, self._reported = self._reported, trouble
        if trouble is None:
            if not self._boot.kept:
                self._boot = keep(self._boot, self._directory, Disk())
            self._set_line_error(FaultCode.STORAGE_FULL, None)
        elif trouble != before:
            self.on_failure(trouble)

    async def watch(self) -> None:
        """Check again while files cannot be written, until cancelled."""
        while True:
            await asyncio.sleep(LOOK_EVERY)
            if self._reported is not None:
                self.look()

    def on_backlog_trouble(self, trouble: str | None) -> None:
        """Take why the backlog cannot be kept on disk; None: it can again."""
        self._backlog = trouble
        self.look()

    def on_failure(self, trouble: str) -> None:
        """Take the error of a failed write."""
        log.warning("%s", trouble)
        self._set_line_error(FaultCode.STORAGE_FULL, trouble)
