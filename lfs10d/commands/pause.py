"""The port freed for another program for a while, on request. Used in the thread of the asyncio loop."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from lfs10d.telemetry.line_state import PAUSED


class LinePause:
    """`pause` gives the port back and returns when it is free, `resume` opens it again.

    `act` tells what the line is busy with (None: as usual).
    """

    def __init__(
        self,
        *,
        pause: Callable[[], Awaitable[None]],
        resume: Callable[[], None],
        act: Callable[[str | None], None],
    ) -> None:
        self._pause = pause
        self._resume = resume
        self._act = act
        self._ending: asyncio.TimerHandle | None = None

    @property
    def paused(self) -> bool:
        """Whether the port is another program's."""
        return self._ending is not None

    async def pause(self, duration: float) -> None:
        """Free the port for `duration` s from now on, whatever was said before; return when it is free."""
        if self._ending is not None:
            self._ending.cancel()
        self._act(PAUSED)
        self._ending = asyncio.get_running_loop().call_later(duration, self.end)
        await self._pause()

    def end(self) -> bool:
        """Take the port back; whether it was freed."""
        if self._ending is None:
            return False
        self._ending.cancel()
        self._ending = None
        self._act(None)  # first: that the port is still gone must count as an error again
        self._resume()
        return True
