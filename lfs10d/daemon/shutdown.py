"""When the daemon ends, and whether by an internal error."""

from __future__ import annotations

import asyncio


class Shutdown:
    """Ends the daemon once it is requested. Built and used in the thread of the asyncio loop."""

    def __init__(self) -> None:
        self._requested = asyncio.Event()
        self.exit_code = 0

    def request(self) -> None:
        """End the daemon, in order."""
        self._requested.set()

    def fail(self) -> None:
        """End the daemon with exit code 1, after an internal error that is logged; its service manager restarts it."""
        self.exit_code = 1
        self._requested.set()

    async def wait(self) -> None:
        """Wait until the daemon is to end."""
        await self._requested.wait()
