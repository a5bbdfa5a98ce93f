"""The line thread: a blocking wait on the port and a wake pipe around `Poller.turn`."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
from collections.abc import Callable

from lfs10d.line.poller import Poller
from lfs10d.modbus.bus import Wait

IDLE_MOST = 5.0
"""Longest time in s between two turns, so that a watchdog can tell idle from hanging."""
SPEAK_MOST = 0.3
"""Time in s for a request under way at the end to leave the wire: eight characters at 1200 baud take 0.08."""
WORTH_SLEEPING = 0.0002
"""A wait shorter than this (s) is not split in two."""
WAKING = 0.0001
"""The thread wakes up this many seconds before a deadline: scheduling takes 0.05 to 0.1 ms. It then takes a turn,
which brings its code back into the processor's caches, and waits the rest awake."""
WAKING_REALTIME = 0.0002
"""The same where the line goes before everything else: 0.3 to 0.7 % more polls for up to a tenth more of the processor,
for where the processor sleeps deeply 0.1 ms is gone before the turn can be taken."""
REFUSED_PAUSE = 0.01
"""Wait in s if the system refuses to watch the port: the next read reports why."""


class LineThread(threading.Thread):
    """Runs `poller` until `stop`; `prepare` is called first in the thread, `failed` with an internal error.

    `declared` is the monotonic time by which the next turn is promised: a watchdog may hold the thread to it. `waking`
    is how long before a moment, in s, it is to be awake.
    """

    def __init__(self, poller: Poller, *, prepare: Callable[[], None], failed: Callable[[BaseException], None]) -> None:
        super().__init__(name="line", daemon=True)
        self.declared = time.monotonic() + IDLE_MOST
        self.waking = WAKING
        self._poller = poller
        self._prepare = prepare
        self._failed = failed
        self._stopping = False
        self._woken, self._waker = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)

    def wake(self) -> None:
        """Make the thread take a turn now; callable from any thread."""
        with contextlib.suppress(BlockingIOError):  # full of wake-ups: one is enough
            os.write(self._waker, b"w")

    def stop(self) -> None:
        """Let the thread close the port and end."""
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
                readable = self._wait(wait)
        except BaseException as error:  # noqa: BLE001 - the daemon must learn of whatever ended its line
            self._failed(error)
        finally:
            time.sleep(min(max(self._poller.bus.speaking_until - time.monotonic(), 0.0), SPEAK_MOST))
            self._poller.bus.close()

    def _wait(self, wait: Wait) -> bool:
        """Wait until the time given, a wake-up or shortly before the deadline; return whether the port may be readable.

        Where the wait is not hurried nothing is done ahead of its time.
        """
        now = time.monotonic()
        until = min(wait.until, now + IDLE_MOST)
        self.declared = max(until, now)
        waking = self.waking if wait.hurried else 0.0
        ahead = wait.not_before - waking - now
        if ahead > WORTH_SLEEPING:
            if self._select([self._woken], min(ahead, IDLE_MOST)):
                return wait.listen
            now = time.monotonic()
        left = until - now - waking
        if left <= 0.0:
            left = 0.0
            while time.monotonic() < until:
                pass
        # What came while nobody looked must be read before time is called: hence a look even where no time is left.
        if not wait.listen:
            self._select([self._woken], left)
            return False
        port = self._poller.bus.port.fileno()
        return port in self._select([self._woken, port], left)

    def _select(self, watched: list[int], timeout: float) -> list[int]:
        """Wait until one of `watched` can be read, at most `timeout` s; return which; all where the system refuses."""
        try:
            ready, _, _ = select.select(watched, [], [], timeout)
        except (OSError, ValueError):  # the descriptor is gone or cannot be watched
            time.sleep(min(timeout, REFUSED_PAUSE))
            return watched
        if self._woken in ready:
            with contextlib.suppress(BlockingIOError):
                os.read(self._woken, 4096)
        return ready
