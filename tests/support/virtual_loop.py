"""An asyncio loop in virtual time that knows whether anything is to be done now."""

from __future__ import annotations

import asyncio
import heapq
from collections.abc import Callable
from contextvars import Context
from typing import TypeVarTuple

from tests.support.virtual_port import VirtualClock

Ts = TypeVarTuple("Ts")
ENDLESS = 10_000
"""So many turns of the loop at one moment are no progress."""


class Loop(asyncio.SelectorEventLoop):
    """Idle turns cost nothing; timers fire when `clock` says so."""

    def __init__(self) -> None:
        super().__init__()
        self.clock = VirtualClock()
        self._stirred = False
        self._timers: list[float] = []

    def time(self) -> float:
        return self.clock.now

    def call_soon(
        self, callback: Callable[[*Ts], object], *args: *Ts, context: Context | None = None
    ) -> asyncio.Handle:
        self._stirred = True
        return super().call_soon(callback, *args, context=context)

    def call_soon_threadsafe(
        self, callback: Callable[[*Ts], object], *args: *Ts, context: Context | None = None
    ) -> asyncio.Handle:
        self._stirred = True
        return super().call_soon_threadsafe(callback, *args, context=context)

    def call_at(
        self, when: float, callback: Callable[[*Ts], object], *args: *Ts, context: Context | None = None
    ) -> asyncio.TimerHandle:
        heapq.heappush(self._timers, when)
        return super().call_at(when, callback, *args, context=context)

    def drain(self) -> None:
        """Do all that can be done now."""
        turns = 0
        while self._stirred or (self._timers and self._timers[0] <= self.clock.now):
            while self._timers and self._timers[0] <= self.clock.now:
                heapq.heappop(self._timers)
            self._stirred = False
            super().call_soon(self.stop)
            self.run_forever()
            turns += 1
            assert turns < ENDLESS, "tasks wake one another for ever"
