"""The demo's processes and its folder; neither outlives the demo, however it ends.

In order: `end` asks the children to go and the folder is removed. Killed: the kernel kills the children
(`parent_guard`), and the caretaker, a shell in a session of its own that waits for the end of a pipe only we hold open,
removes the folder. The caretaker is the only one to remove it, so that way is the one always taken.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from lfs10d.cli.demo import parent_guard
from lfs10d.errors import FailedError
from lfs10d.system.dataclass import dataclass
from lfs10d.system.logs import escape

DAEMON: Final = "daemon"
LOOK_AGAIN: Final = 0.02
START_WITHIN: Final = 20.0
"""Seconds a child may take to be ready; none takes two on an idle machine."""
DAEMON_ENDS_WITHIN: Final = 1.2
OTHERS_END_WITHIN: Final = 0.4
"""Seconds from SIGTERM to SIGKILL; together with the removal less than the two that Ctrl-C may take."""

_CARETAKER: Final = 'read -r _; rm -rf -- "$0" || { sleep 1; rm -rf -- "$0"; }'

_OF_A_SERVICE: Final = frozenset(
    {
        "LFS10D_CONFIG",
        "STATE_DIRECTORY",
        "RUNTIME_DIRECTORY",
        "CREDENTIALS_DIRECTORY",
        "NOTIFY_SOCKET",
        "WATCHDOG_PID",
        "WATCHDOG_USEC",
        "XDG_RUNTIME_DIR",
    }
)
"""Environment variables through which a child would use files of a real daemon on this machine."""

PYTHON: Final = (sys.executable, "-P")
"""Starts one of our modules; -P: never a file of the same name in the current folder."""


@dataclass(frozen=True, slots=True)
class Child:
    """One process of the demo; `name` is for people."""

    name: str
    process: subprocess.Popen[bytes]
    log: Path

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self.process.poll() is None

    def last_words(self) -> str:
        """Return the last line it wrote."""
        lines = self.log.read_text(errors="replace").split("\n") if self.log.exists() else []
        return next((escape(line.strip()) for line in reversed(lines) if line.strip()), "it printed nothing")


class Children:
    """The folder and the processes that use it, in order of their start."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._started: list[Child] = []

    def start(self, name: str, *command: str) -> Child:
        """Start a program by its path, without a terminal; what it writes goes to `NAME.log` in the folder."""
        environment = {key: value for key, value in os.environ.items() if key not in _OF_A_SERVICE}
        environment["RUNTIME_DIRECTORY"] = str(self.folder)
        path = self.folder / f"{name}.log"
        with path.open("wb") as log:
            process = subprocess.Popen(  # noqa: S603  # our own programs, and mosquitto
                [sys.executable, "-I", "-S", str(parent_guard.ITSELF), str(os.getpid()), *command],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=environment,
                start_new_session=True,  # Ctrl-C is for us alone: we end them in order
            )
        child = Child(name, process, path)
        self._started.append(child)
        return child

    async def ready(self, child: Child, claim: Callable[[], bool]) -> bool:
        """Wait until `claim()` holds; return False if the child ends before that or it takes too long."""
        return await _comes_true(lambda: claim() or not child.alive, START_WITHIN) and child.alive

    def check(self) -> None:
        """Raise FailedError if a child that was ready has ended."""
        for child in self._started:
            if not child.alive:
                raise FailedError(f"the demo's {child.name} has ended: {child.last_words()}")

    async def discard(self, child: Child) -> None:
        """End a child that is not needed."""
        self._started.remove(child)
        await _end([child], OTHERS_END_WITHIN)

    async def end(self) -> None:
        """End all, the daemon first, so that it can publish `offline`."""
        await _end([child for child in self._started if child.name == DAEMON], DAEMON_ENDS_WITHIN)
        await _end([child for child in self._started if child.name != DAEMON], OTHERS_END_WITHIN)


async def _end(children: list[Child], within: float) -> None:
    for child in children:
        child.process.terminate()
    await _comes_true(lambda: not any(child.alive for child in children), within)
    for child in children:
        child.process.kill()
        child.process.wait()


async def _comes_true(claim: Callable[[], bool], within: float) -> bool:
    """Wait until `claim()` holds, at most `seconds`; return whether it does."""
    deadline = time.monotonic() + within
    while not claim():
        if time.monotonic() > deadline:
            return False
        await asyncio.sleep(LOOK_AGAIN)
    return True


@contextlib.contextmanager
def temporary_folder() -> Iterator[Path]:
    """Give an empty folder that is gone afterwards, even if we are killed."""
    folder = tempfile.mkdtemp(prefix="lfs10d-demo-")
    caretaker = subprocess.Popen(  # noqa: S603  # a line of ours
        ["/bin/sh", "-c", _CARETAKER, folder],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield Path(folder)
    finally:
        caretaker.communicate()
