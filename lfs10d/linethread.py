"""The line thread: a blocking wait on the port and a wake pipe around `Poller.turn`."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from lfs10d.modbus.bus import Wait
    from lfs10d.poller import Poller

IDLE_MOST = 5.0
"""The thread passes a turn at least so often, in s, so that a watchdog can tell idle from wedged."""
SPEAK_MOST = 0.3
"""A request under way at the end is let out for so long, in s: eight characters at 1200 baud take 0.08."""
WORTH_SLEEPING = 0.0002
"""A wait shorter than this (s) is not split in two."""
REFUSED_PAUSE = 0.01
"""How long to wait where the system refuses to watch the port, in s: the next read tells why."""


class LineThread(threading.Thread):
    """Runs `poller` until `stop`; `prepare` is called first, in the thread; `failed` with what ended it by mistake.

    `declared` is the monotonic time by which the next turn is promised: a watchdog may hold the thread to it.
    """

    def __init__(self, poller: Poller, *, prepare: Callable[[], None], failed: Callable[[BaseException], None]) -> None:
        super().__init__(name="line", daemon=True)
        self.declared = time.monotonic() + IDLE_MOST
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
        self.declared = time.monotonic() + IDLE_MOST
        try:
            self._prepare()
            readable = True
            while not self._stopping:
                wait = self._poller.turn(time.monotonic(), readable=readable)
                self._wait(wait)
                # What came while nobody looked must be read before time is called.
                readable = wait.listen
        except BaseException as error:  # noqa: BLE001 - the daemon must learn of whatever ended its line
            self._failed(error)
        finally:
            time.sleep(min(max(self._poller.bus.speaking_until - time.monotonic(), 0.0), SPEAK_MOST))
            self._poller.bus.close()

    def _wait(self, wait: Wait) -> None:
        """Wait as told, or until woken."""
        now = time.monotonic()
        self.declared = now + min(max(wait.until - now, 0.0), IDLE_MOST)
        if wait.not_before - now > WORTH_SLEEPING:
            if self._select([self._woken], min(wait.not_before - now, IDLE_MOST)):
                return
            now = time.monotonic()
        watched = [self._woken]
        if wait.listen:
            watched.append(self._poller.bus.port.fileno())
        self._select(watched, min(max(wait.until - now, 0.0), IDLE_MOST))

    def _select(self, watched: list[int], timeout: float) -> bool:
        """Wait until one of `watched` can be read, at most `timeout` s; whether one can."""
        try:
            ready, _, _ = select.select(watched, [], [], timeout)
        except (OSError, ValueError):  # the descriptor is gone or cannot be watched
            time.sleep(min(timeout, REFUSED_PAUSE))
            return True
        if self._woken in ready:
            with contextlib.suppress(BlockingIOError):
                os.read(self._woken, 4096)
        return bool(ready)
