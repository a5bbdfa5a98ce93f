"""What time it is on both clocks, and how far the wall clock can be trusted."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable

from lfs10d import clock, clockstep
from lfs10d.aside import aside
from lfs10d.facts import Instant


class Moments:
    """`synchronised()` is called whenever the wall clock has become synchronised.

    `stepped()` is called when it was set while it was not known to be synchronised. Built and used in one thread.
    """

    def __init__(self, synchronised: Callable[[], None], stepped: Callable[[], None]) -> None:
        self._synchronised = synchronised
        self._stepped = stepped
        self._state: clock.ClockState = "unknown"
        self._start = time.monotonic()
        self._shift = round((time.time() - self._start) * 1000)
        self._set = asyncio.Event()
        """The wall clock was set since `watch` has looked."""

    def now(self) -> Instant:
        """Return this moment."""
        now = Instant(time.monotonic(), time.time(), self._state)
        shift = round((now.wall - now.mono) * 1000)
        if clockstep.stepped(self._shift, shift):
            self._set.set()
        self._shift = shift
        return now

    async def watch(self) -> None:
        """Look after the wall clock until cancelled; at once when it was set."""
        while True:
            if self._set.is_set():
                self._set.clear()
                if self._state != "synced":
                    self._stepped()
            before, self._state = self._state, await aside(clock.look, "clock")
            if self._state == "synced" != before:
                self._synchronised()
            patience = clock.look_again(self._state, time.monotonic() - self._start)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._set.wait(), patience)
