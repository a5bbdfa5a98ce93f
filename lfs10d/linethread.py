"""The line thread: a blocking wait on the port and a wake pipe around `Poller.turn`."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
from math import inf
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from lfs10d.modbus.bus import Wait
    from lfs10d.poller import Poller

IDLE_MOST = 5.0
"""The thread passes a turn at least so often, in s, so that a watchdog can tell idle from wedged."""
WORTH_SLEEPING = 0.0002
"""A wait shorter than this (s) is not split in two."""


class LineThread(threading.Thread):
    """Runs `poller` until `stop`; `prepare` is called first, in the thread; `failed` with what ended it by mistake."""

    def __init__(self, poller: Poller, *, prepare: Callable[[], None], failed: Callable[[BaseException], None]) -> None:
        super().__init__(name="line", daemon=True)
        self.declared = inf
        self._poller = poller
        self._prepare = prepare
        self._failed = failed
        self._stopping = False
        self._woken, self._waker = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)

    def wake(self) -> None:
        """Have the thread take a turn now; from any thread."""
        with contextlib.suppress(BlockingIOError):  # full of wake-ups: one is enough
            os.write(self._waker, b"w")

    def stop(self) -> None:
        """Have the thread give the port back and end."""
        self._stopping = True
        self.wake()

    def run(self) -> None:
        """Take turns until `stop`."""
        try:
            self._prepare()
            readable = True
            while not self._stopping:
                wait = self._poller.turn(time.monotonic(), readable=readable)
                readable = self._wait(wait)
        except BaseException as error:  # noqa: BLE001 - the daemon must learn of whatever ended its line
            self._failed(error)
        finally:
            self._poller.bus.close()

    def _wait(self, wait: Wait) -> bool:
        """Wait as told; return whether the port has something to read."""
        now = time.monotonic()
        self.declared = now + min(max(wait.until - now, 0.0), IDLE_MOST)
        if wait.not_before - now > WORTH_SLEEPING:
            if self._select([self._woken], wait.not_before - now):
                return True
            now = time.monotonic()
        fds = [self._woken]
        if wait.listen:
            fds.append(self._poller.bus.port.fileno())
        ready = self._select(fds, min(max(wait.until - now, 0.0), IDLE_MOST))
        return any(fd != self._woken for fd in ready)

    def _select(self, fds: list[int], timeout: float) -> list[int]:
        ready, _, _ = select.select(fds, [], [], timeout)
        if self._woken in ready:
            with contextlib.suppress(BlockingIOError):
                os.read(self._woken, 4096)
        return ready
