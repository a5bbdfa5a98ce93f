"""The simulated line on a pseudo terminal, paced in real time, for any master that opens a serial port.

A thread of its own hands over each byte when its last bit would have arrived. It reads the rate the master has
set at each byte: at another rate bytes are noise. While nobody has the terminal open, bytes are lost, as on a
closed serial port. A pseudo terminal knows no parity and no data bits (Linux, `pty_set_termios`): those are taken
from the line itself.
"""

from __future__ import annotations

import errno
import os
import select
import termios
import threading
import time
import tty
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final, Self

from lfs10d.errors import FailedError
from lfs10d.modbus.realtime import sharpen_timers, take_precedence
from lfs10d.simulator.adapter import Adapter
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.wire import SECOND, nanoseconds

READ_SIZE: Final = 4096
LOOK_FOR_MASTER: Final = 0.002
"""Seconds between two checks whether the terminal was opened; the kernel gives no notice."""
LONGEST_SLEEP: Final = 1.0
STOP_WITHIN: Final = 2.0
_OUTPUT_RATE = 5  # place in what tcgetattr returns
_RATES: Final = {
    getattr(termios, name): int(name[1:])
    for name in dir(termios)
    if name.startswith("B") and name[1:].isdigit() and name != "B0"
}


class PtyLine:
    """Serves a line on a pseudo terminal between `start` and `stop`, or in a `with`.

    Stop and start again are the adapter unplugged and plugged in: the terminal goes and another comes, by the
    same link. The line's time 0 is the first start. Change the line from other threads by `tell`.
    """

    def __init__(
        self,
        line: SimulatedLine,
        *,
        link: Path | None = None,
        echo: bool = False,
        latency: float = 0.0,
        realtime: bool = False,
    ) -> None:
        self.line = line
        self.link = link
        self.realtime = realtime
        self.adapter = Adapter(line, line.format, echo=echo, latency=nanoseconds(latency))
        self.present = False
        """Whether somebody has the terminal open."""
        self.openings = 0
        self.lost_bytes = 0
        """What the terminal did not take because nobody read it."""
        self.terminal = ""
        """The terminal itself, /dev/pts/...; another one after each start."""
        self._master = -1
        self._wake = (-1, -1)
        self._thread: threading.Thread | None = None
        self._stopping = False
        self._origin: int | None = None
        self._told: SimpleQueue[Callable[[SimulatedLine], None]] = SimpleQueue()

    def __enter__(self) -> Self:
        """Start."""
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop."""
        self.stop()

    @property
    def path(self) -> str:
        """What a master opens: the link if there is one, else the terminal."""
        return str(self.link) if self.link is not None else self.terminal

    def now(self) -> float:
        """Return the line's time in seconds."""
        return 0.0 if self._origin is None else (time.monotonic_ns() - self._origin) / SECOND

    def start(self) -> None:
        """Open a terminal, make the link, begin to serve; FailedError if either is impossible."""
        try:
            self._master, slave = os.openpty()
        except OSError as error:
            raise FailedError(f"no pseudo terminal to be had: {error.strerror}") from error
        tty.setraw(slave)
        self.terminal = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        try:
            self._make_link()
        except OSError as error:
            os.close(self._master)
            raise FailedError(f"{self.link}: the link cannot be made: {error.strerror}") from error
        self._wake = os.pipe()
        self._stopping = False
        self.present = False
        if self._origin is None:
            self._origin = time.monotonic_ns()
        self._thread = threading.Thread(target=self._serve, name="simulated-line", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End serving, remove terminal and link; a second time does nothing."""
        if self._thread is None:
            return
        self._stopping = True
        os.write(self._wake[1], b"s")
        self._thread.join(STOP_WITHIN)
        self._thread = None
        self._remove_link()
        for descriptor in (self._master, *self._wake):
            os.close(descriptor)

    def tell(self, action: Callable[[SimulatedLine], None]) -> None:
        """Let the line's own thread call `action(line)`, at once."""
        self._told.put(action)
        if self._thread is not None:
            os.write(self._wake[1], b"t")

    def summary(self) -> dict[str, Any]:
        """Return the judge's figures and what happened at the terminal, ready for JSON."""
        return {
            "seconds": round(self.now(), 3),
            **self.line.judge.summary(),
            "answers": self.line.answered,
            "openings": self.openings,
            "lost_bytes": self.lost_bytes,
        }

    def _make_link(self) -> None:
        if self.link is None:
            return
        if self.link.exists() and not self.link.is_symlink():
            raise FileExistsError(errno.EEXIST, "something else has this name")
        beside = self.link.with_name(f".{self.link.name}.{os.getpid()}")
        beside.symlink_to(self.terminal)
        beside.replace(self.link)

    def _remove_link(self) -> None:
        with suppress(OSError):
            if self.link is not None and str(self.link.readlink()) == self.terminal:
                self.link.unlink()

    def _time(self) -> int:
        return time.monotonic_ns() - (self._origin or 0)

    def _serve(self) -> None:
        sharpen_timers()
        if self.realtime:
            take_precedence()
        self._find_master()
        while not self._stopping:
            self._obey()
            self._look_at_rate()
            self._hand_over()
            listened = [self._wake[0], self._master] if self.present else [self._wake[0]]
            readable, _, _ = select.select(listened, [], [], self._pause())
            if self._wake[0] in readable:
                os.read(self._wake[0], READ_SIZE)
            if not self.present:
                self._find_master()
            elif self._master in readable:
                self._listen()

    def _pause(self) -> float:
        """Return how long nothing is to be done (s)."""
        times = [when for when in (self.adapter.next_ready(), self.line.next_event()) if when is not None]
        longest = LONGEST_SLEEP if self.present else LOOK_FOR_MASTER
        return min(longest, max(0, min(times) - self._time()) / SECOND) if times else longest

    def _obey(self) -> None:
        with suppress(Empty):
            while True:
                action = self._told.get_nowait()
                self.line.advance(self._time())
                action(self.line)

    def _look_at_rate(self) -> None:
        attributes = termios.tcgetattr(self._master)
        rate = _RATES.get(attributes[_OUTPUT_RATE], 0)
        if rate and rate != self.adapter.format.baudrate:
            now = self._time()
            self.line.advance(now)
            self.line.strike(now)
            self.adapter.retune(replace(self.adapter.format, baudrate=rate), now)

    def _hand_over(self) -> None:
        now = self._time()
        self.line.advance(now)
        data = self.adapter.collect(now)
        if not data or not self.present:
            return
        self.line.handed_over(now)
        try:
            taken = os.write(self._master, data)
        except OSError:
            taken = 0
        self.lost_bytes += len(data) - taken

    def _listen(self) -> None:
        """Take what the master has written; notice that it has closed."""
        try:
            data = os.read(self._master, READ_SIZE)
        except BlockingIOError:
            return
        except OSError:
            with suppress(termios.error):
                termios.tcflush(self._master, termios.TCIOFLUSH)
            self.present = False
            return
        self._look_at_rate()
        self.line.transmit(data, self._time(), self.adapter.format)

    def _find_master(self) -> None:
        """Notice that the terminal was opened."""
        poll = select.poll()
        poll.register(self._master, select.POLLIN)
        if not any(flags & select.POLLHUP for _, flags in poll.poll(0)):
            self.present = True
            self.openings += 1
            self._listen()
