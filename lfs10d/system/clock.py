"""Finds out whether the wall clock is synchronised, from systemd: the daemon's sandbox forbids adjtimex.

systemd-timesyncd leaves a mark in /run once it has set the clock. Any other (chrony, ntpd) is known to timedate1,
which reads the kernel's flag. Without both the state is unknown.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from lfs10d.system import clock_step
from lfs10d.system.clock_step import ClockState
from lfs10d.system.dataclass import dataclass
from lfs10d.system.threads import run_in_thread

MARK = Path("/run/systemd/timesync/synchronized")
"""Touched by systemd-timesyncd at each synchronisation (systemd-timesyncd.service(8)); /run is empty after a boot."""

QUESTION = ("timedatectl", "show", "--property=NTPSynchronized", "--value")
"""org.freedesktop.timedate1 in words; prints yes or no."""
ANSWERS: dict[str | None, ClockState] = {"yes": "synced", "no": "unsynced"}

PATIENCE = 2.0
"""Seconds that timedate1 may take: the question starts it."""

LOOK_AGAIN: dict[ClockState, float] = {"synced": 600.0, "unsynced": 15.0, "unknown": 600.0}
"""Seconds until timedate1 is asked again; a clock is usually synchronised within a minute of the network."""

SOON_AFTER_START = 600.0
"""Seconds after the start during which `unknown` is asked again soon: timedate1 may still be starting."""


LOOKS = 3
TOGETHER = 0.0005
"""s between two reads of the clocks that count as one moment: `ts` is in ms."""


def look_again(state: ClockState, age: float) -> float:
    """Return in how many seconds to look again, `age` seconds after the start."""
    soon = state == "unknown" and age < SOON_AFTER_START
    return LOOK_AGAIN["unsynced" if soon else state]


def look(*, mark: Path = MARK, question: Sequence[str] = QUESTION, patience: float = PATIENCE) -> ClockState:
    """Return the state of the wall clock. Blocks up to `patience` seconds, so never call it on loop or line thread."""
    if os.path.lexists(mark):
        return "synced"
    return judge(_ask(question, patience))


def judge(answer: str | None) -> ClockState:
    """Take timedate1's answer, None if there was none."""
    return ANSWERS.get(answer, "unknown")


def _ask(question: Sequence[str], patience: float) -> str | None:
    # When it fails it tells the service manager, in our place, which the manager complains of.
    environment = {name: value for name, value in os.environ.items() if name != "NOTIFY_SOCKET"}
    try:
        answer = subprocess.run(  # noqa: S603 - a constant command, no shell
            question,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            timeout=patience,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.decode("ascii", "replace").strip()


@dataclass(frozen=True, slots=True)
class Instant:
    """One moment: `mono` in s of the line thread's clock, `wall` in s since the epoch, and how far `wall` is known."""

    mono: float
    wall: float
    clock: ClockState

    def ts(self, at: float | None = None) -> int:
        """Return epoch milliseconds of this moment, or of the monotonic time `at` as seen from it."""
        return round((self.wall if at is None else self.wall - self.mono + at) * 1000)


def _together() -> tuple[float, float]:
    """Return both clocks, read as close together as possible."""
    mono, wall = time.monotonic(), time.time()
    for _ in range(LOOKS):
        if time.monotonic() - mono < TOGETHER:
            break
        mono, wall = time.monotonic(), time.time()
    return mono, wall


class ClockEvents(Protocol):
    """The events of `Clock.watch`."""

    def synchronised(self) -> None:
        """Note that the wall clock has become synchronised."""

    def stepped(self) -> None:
        """Note that the wall clock was set while it was not known to be synchronised."""


class Clock:
    """The time on both clocks. Built and used in one thread."""

    def __init__(self) -> None:
        self._state: ClockState = "unknown"
        self._start = time.monotonic()
        self._shift = round((time.time() - self._start) * 1000)
        self._set = asyncio.Event()
        """The wall clock was set since the last check of `watch`."""

    def now(self) -> Instant:
        """Return this moment."""
        mono, wall = _together()
        now = Instant(mono, wall, self._state)
        shift = round((now.wall - now.mono) * 1000)
        if clock_step.stepped(self._shift, shift):
            self._set.set()
        self._shift = shift
        return now

    def epoch_ms(self) -> int:
        """Return the wall clock, in epoch milliseconds; `now` alone notices that it was set."""
        return round(time.time() * 1000)

    async def watch(self, events: ClockEvents) -> None:
        """Check the wall clock now and then until cancelled; at once when it was set."""
        while True:
            if self._set.is_set():
                self._set.clear()
                if self._state != "synced":
                    events.stepped()
            before, self._state = self._state, await run_in_thread(look, "clock")
            if self._state == "synced" != before:
                events.synchronised()
            patience = look_again(self._state, time.monotonic() - self._start)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._set.wait(), patience)
