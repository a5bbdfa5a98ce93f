"""What time it is on both clocks, and how far the wall clock can be trusted."""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING

from lfs10d import clock
from lfs10d.aside import aside
from lfs10d.facts import Instant

if TYPE_CHECKING:
    from collections.abc import Callable


class Moments:
    """`synchronised()` is called whenever the wall clock has become synchronised."""

    def __init__(self, synchronised: Callable[[], None]) -> None:
        self._synchronised = synchronised
        self._state: clock.ClockState = "unknown"

    def now(self) -> Instant:
        """Return this moment."""
        return Instant(time.monotonic(), time.time(), self._state)

    async def watch(self) -> None:
        """Look after the wall clock until cancelled."""
        while True:
            before, self._state = self._state, await aside(clock.look, "clock")
            if self._state == "synced" != before:
                self._synchronised()
            await asyncio.sleep(clock.LOOK_AGAIN[self._state])
