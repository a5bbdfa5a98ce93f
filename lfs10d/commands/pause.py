"""Frees the port for another program on request, for a limited time. Used in the asyncio loop."""

from __future__ import annotations

import asyncio
from typing import Protocol

from lfs10d.command import rejected

FREED = rejected("line_error", "the port is freed for another program; see line/cancel")


class PausableLine(Protocol):
    """A line whose port can be freed; see `lfs10d.line.line.Line`."""

    async def pause(self) -> None:
        """Close the port; return when it is free."""

    def resume(self) -> None:
        """Open the port again."""


class SetPaused(Protocol):
    """Publishes whether the port is freed."""

    def __call__(self, *, paused: bool) -> None:
        """Publish it."""


class LinePause:
    """Frees the port, and opens it again when the time is over."""

    def __init__(self, line: PausableLine, set_paused: SetPaused) -> None:
        self._line = line
        self._set_paused = set_paused
        self._timer: asyncio.TimerHandle | None = None

    @property
    def paused(self) -> bool:
        """Whether the port is freed for another program."""
        return self._timer is not None

    async def pause(self, duration: float) -> None:
        """Free the port for `duration` s from now on, in place of a time set before; return when it is free."""
        if self._timer is not None:
            self._timer.cancel()
        self._set_paused(paused=True)
        self._timer = asyncio.get_running_loop().call_later(duration, self.end)
        await self._line.pause()

    def end(self) -> bool:
        """Open the port again; return whether it was freed."""
        if self._timer is None:
            return False
        self._timer.cancel()
        self._timer = None
        self._set_paused(paused=False)  # first: a port that is still gone must count as an error again
        self._line.resume()
        return True
