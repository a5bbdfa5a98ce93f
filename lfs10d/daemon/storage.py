"""Whether files can be written: the state directory, the backlog in it, the changes by request."""

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
"""Seconds from one look to the next while there is trouble."""


class Storage:
    """Logs trouble, and raises it as an error of the line by `set_line_error`; None clears that.

    When the trouble is over, the id of this life (`boot`) is put on the disk if it is not there yet.
    """

    def __init__(
        self, directory: Path, boot: Boot, set_line_error: Callable[[LineFaultCode, str | None], None]
    ) -> None:
        self._directory = directory
        self._boot = boot
        self._set_line_error = set_line_error
        self._backlog: str | None = None
        """Why the backlog cannot be kept."""
        self._reported: str | None = None

    def look(self) -> None:
        """See whether files can be written."""
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
        """Look again while there is trouble, until cancelled: where nothing is stored its end shows nowhere else."""
        while True:
            await asyncio.sleep(LOOK_EVERY)
            if self._reported is not None:
                self.look()

    def on_backlog_trouble(self, trouble: str | None) -> None:
        """Take that the backlog cannot be kept, or (None) can again."""
        self._backlog = trouble
        self.look()

    def on_failure(self, trouble: str) -> None:
        """Take that something could not be written."""
        log.warning("%s", trouble)
        self._set_line_error(FaultCode.STORAGE_FULL, trouble)
