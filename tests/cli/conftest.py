"""What the tests of the verbs share: the program as a person calls it."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import signal
import struct
import subprocess
import termios
from collections.abc import Iterator
from pathlib import Path

import pytest

from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.pty import PtyLine
from tests.support import forked
from tests.support.verbs import AtTerminal, Lfs10d


@pytest.fixture
def lfs10d(tmp_path: Path) -> Lfs10d:
    """Return the program, to be called."""

    def call(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        return forked.run(arguments, cwd=tmp_path, env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), **environment})

    return call


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """Return a valid configuration file, in the folder the program is called in."""
    file = tmp_path / "lfs10d.yaml"
    file.write_text("line: {port: /dev/x}\nslaves: [2, {id: 3, interval: 250ms}]\nmqtt: {host: localhost}\n")
    return file


@pytest.fixture
def at_terminal(tmp_path: Path) -> AtTerminal:
    """Return the program, to be called at a terminal."""

    def call(*arguments: str, columns: int = 80, until: str | None = None) -> tuple[int, str]:
        master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
        environment = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "TERM": "xterm-256color", "LANG": "C.UTF-8"}
        process = forked.start(arguments, cwd=tmp_path, env=environment, stdin=slave, stdout=slave, stderr=slave)
        os.close(slave)
        seen = b""
        with contextlib.suppress(OSError):  # EIO: the program has closed its end
            while piece := os.read(master, 65536):
                seen += piece
                if until is not None and until.encode() in seen:
                    until = None
                    process.send_signal(signal.SIGINT)
        os.close(master)
        return process.wait(timeout=60), seen.decode()

    return call


@pytest.fixture
def sensors(tmp_path: Path) -> Iterator[PtyLine]:
    """Give a line without sensors on a pseudo terminal, as punctual as is permitted; `tell` it to `add` some."""
    with PtyLine(SimulatedLine(seed=1), link=tmp_path / "line0", realtime=True) as line:
        yield line
