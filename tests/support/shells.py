"""Verbs of the command line as processes."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import termios
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.support import forked
from tests.support.forked import Process
from tests.support.sites import ENDS_WITHIN, PATIENCE, Run, Site, eventually

BASE = "lfs10d/line0"


def words(site: Site, verb: str, *arguments: str) -> list[str]:
    return [verb, "-c", str(site.file), *arguments]


def environment(runtime: Path | None = None, **more: str) -> dict[str, str]:
    """Return the variables of a person's shell; `runtime` is where a daemon's status file can be found."""
    kept = {name: value for name, value in os.environ.items() if name not in {"XDG_RUNTIME_DIR", "RUNTIME_DIRECTORY"}}
    return {**kept, **({} if runtime is None else {"RUNTIME_DIRECTORY": str(runtime)}), **more}


def typed(site: Site, verb: str, *arguments: str, runtime: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Call a verb that ends by itself, in a pipe."""
    return forked.run(words(site, verb, *arguments), env=environment(runtime))


@dataclass
class Running:
    """A verb that goes on until it is told to end, with what it printed so far; `master` is that of its terminal."""

    process: Process
    source: int
    raw: bytes = b""

    def read(self, seconds: float = 0.05) -> bool:
        """Take what there is; whether there may be more."""
        if not select.select([self.source], [], [], seconds)[0]:
            return True
        try:
            data = os.read(self.source, 65_536)
        except OSError:  # the terminal is closed
            return False
        self.raw += data
        return bool(data)

    @property
    def text(self) -> str:
        """What was printed, without what moves the cursor."""
        return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", self.raw.decode(errors="replace")).replace("\r\n", "\n")

    def says(self, words: str, *, since: int = 0, within: float = PATIENCE) -> None:
        """Wait until these words were printed, beyond the first `since` characters."""

        def said() -> bool:
            self.read()
            return words in self.text[since:]

        try:
            eventually(said, f"{words!r} in what is printed", within=within)
        except AssertionError as error:
            raise AssertionError(f"{error}:\n{self.text[since:][-4000:]}") from None

    def ends(self, number: int | None = None) -> int:
        """Send a signal and return the exit code; it must come within the time of the contract."""
        if number is not None:
            self.process.send_signal(number)
        begun = time.monotonic()
        while self.process.poll() is None:
            self.read()
            assert time.monotonic() < begun + 30, "it does not end"
        if number is not None:
            assert time.monotonic() - begun < ENDS_WITHIN
        while self.read(0.0) and select.select([self.source], [], [], 0)[0]:
            pass
        return self.process.wait()


@dataclass
class Shell:
    """Starts verbs in a pipe or on a terminal."""

    site: Site
    running: list[Running] = field(default_factory=list)

    def pipe(self, verb: str, *arguments: str, runtime: Path | None = None) -> Running:
        source, sink = os.pipe()
        process = forked.start(
            words(self.site, verb, *arguments),
            stdout=sink,
            stderr=sink,
            env=environment(runtime, PYTHONUNBUFFERED="1"),
        )
        os.close(sink)
        return self._keep(Running(process, source))

    def terminal(
        self, verb: str, *arguments: str, columns: int = 80, lines: int = 24, runtime: Path | None = None
    ) -> Running:
        master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
        process = forked.start(
            words(self.site, verb, *arguments),
            stdin=slave,
            stdout=slave,
            stderr=slave,
            env=environment(runtime, TERM="xterm-256color", NO_COLOR="1"),
        )
        os.close(slave)
        return self._keep(Running(process, master))

    def _keep(self, running: Running) -> Running:
        self.running.append(running)
        return running

    def close(self) -> None:
        for running in self.running:
            if running.process.poll() is None:
                running.process.kill()
            running.process.wait()
            os.close(running.source)
            assert "Traceback" not in running.text
            assert "internal error of lfs10d" not in running.text


def running(site: Site, **sections: Any) -> Run:  # noqa: ANN401 - as Site.write
    """Start a line and a daemon and wait until its sensors are online."""
    served = site.line((1, 2))
    del served
    site.write(slaves=[1, {"id": 2, "name": "mast-top", "label": "Mast, 10 m"}], **sections)
    run = site.run()
    run.ready()
    eventually(lambda: b'"broker":{"connected":true' in _content(run.status), "the daemon is at the broker")
    return run


def _content(file: Path) -> bytes:
    return file.read_bytes() if file.exists() else b""
