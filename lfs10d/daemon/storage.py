"""Whether what must be kept can be kept: the state directory, the backlog in it, what requests changed."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from pathlib import Path

from lfs10d.daemon.state_directory import prepare
from lfs10d.errors import StateError

log = logging.getLogger(__name__)


LOOK_EVERY = 5.0
"""Seconds from one look to the next while there is trouble."""


class Storage:
    """`tell(trouble)` is called when it begins, is another, or (None) is over; it is logged here."""

    def __init__(self, directory: Path, tell: Callable[[str | None], None]) -> None:
        self._directory = directory
        self._tell = tell
        self._backlog: str | None = None
        """Why the backlog cannot be kept."""
        self._told: str | None = None

    def look(self) -> None:
        """See whether files can be written."""
        trouble = self._backlog
        try:
            prepare(self._directory)
        except StateError as error:
            trouble = str(error)
        before, self._told = self._told, trouble
        if trouble is None:
            self._tell(None)
        elif trouble != before:
            self.failed(trouble)

    async def watch(self) -> None:
        """Look again while there is trouble, until cancelled: where nothing is stored nobody else finds its end."""
        while True:
            await asyncio.sleep(LOOK_EVERY)
            if self._told is not None:
                self.look()

    def backlog_failed(self, trouble: str | None) -> None:
        """Take that the backlog cannot be kept, or (None) can again."""
        self._backlog = trouble
        self.look()

    def failed(self, trouble: str) -> None:
        """Take that something could not be written."""
        log.warning("%s", trouble)
        self._tell(trouble)
