"""Frees the port for another program on request, for a limited time. Used in the asyncio loop."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from lfs10d.command import rejected

if TYPE_CHECKING:  # as in `lfs10d.commands.context`
    from lfs10d.line.line import Line
    from lfs10d.mqtt.publisher import Publisher

FREED = rejected("line_error", "the port is freed for another program; see line/cancel")


class LinePause:
    """Frees the port, and opens it again when the time is over."""

    def __init__(self, line: Line, publisher: Publisher) -> None:
        self._line = line
        self._publisher = publisher
        self._timer: asyncio.TimerHandle | None = None

    @property
    def paused(self) -> bool:
        """Whether the port is freed for another program."""
        return self._timer is not None

    async def pause(self, duration: float) -> None:
        """Free the port for `duration` s from now on, in place of a time set before; return when it is free."""
        if self._timer is not None:
            self._timer.cancel()
        self._publisher.set_paused(paused=True)
        self._timer = asyncio.get_running_loop().call_later(duration, self.end)
        await self._line.pause()

    def end(self) -> bool:
        """Open the port again; return whether it was freed."""
        if self._timer is None:
            return False
        self._timer.cancel()
        self._timer = None
        self._publisher.set_paused(paused=False)  # first: a port that is still gone must count as an error again
        self._line.resume()
        return True
