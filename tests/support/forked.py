"""lfs10d as a process that need not import: forked from one that has. Every start is a second of computing cheaper.

`start` and `run` are for `python -m lfs10d ...` what `subprocess.Popen` and `subprocess.run` are: a process of its own,
with the arguments, variables, folder and files that are given; it begins where `lfs10d/__main__.py` does. What is not
the same: `/proc/PID/cmdline`, and the interpreter has read its own variables (`PYTHON...`, the locale) before. Where
those differ from ours, or the start itself is the subject, take `subprocess`. A daemon may be given another `pace`.
"""

from __future__ import annotations

import array
import atexit
import contextlib
import dataclasses
import gc
import importlib
import json
import os
import selectors
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import IO, Any, Protocol

from lfs10d import __main__ as program
from lfs10d.daemon.pace import Pace
from lfs10d.system import startup

ROOT = Path(__file__).parents[2]
MODULES = (
    *(f"lfs10d.cli.{verb}" for verb in ("run", "check", "config", "scan", "read", "request", "watch", "trace")),
    *(f"lfs10d.cli.{verb}" for verb in ("profiles", "simulate")),
    *("lfs10d.cli.exit_status", "lfs10d.daemon.daemon", "lfs10d.cli.render"),
)
ORDER = 1 << 20
"""Bytes of the longest order."""
STATUS = struct.Struct("i")


class Process(Protocol):
    """What tests do with a process they started; `subprocess.Popen` is one."""

    pid: int
    returncode: int | None

    def poll(self) -> int | None:
        """Return its exit code, None while it runs."""

    def wait(self, timeout: float | None = None) -> int:
        """Wait until it has ended and return its exit code."""

    def send_signal(self, sig: int) -> None:
        """Send a signal if it runs."""

    def kill(self) -> None:
        """End it at once."""


class Forked:
    """One process; `told` is where its id and its exit code come from."""

    def __init__(self, told: socket.socket) -> None:
        self._told = told
        (self.pid,) = STATUS.unpack(told.recv(STATUS.size))
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Return its exit code, negative the number of the signal that ended it; None while it runs."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end and return its exit code; TimeoutExpired after `timeout` seconds."""
        if self.returncode is None:
            self._told.settimeout(timeout)
            try:
                (self.returncode,) = STATUS.unpack(self._told.recv(STATUS.size))
            except (BlockingIOError, TimeoutError):
                raise subprocess.TimeoutExpired("lfs10d", timeout or 0) from None
            self._told.close()
        return self.returncode

    def send_signal(self, sig: int) -> None:
        """Send a signal if it runs."""
        if self.poll() is None:
            os.kill(self.pid, sig)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)


class Imported:
    """The process that has imported lfs10d and forks."""

    def __init__(self) -> None:
        self.control, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            command = [sys.executable, "-m", "tests.support.forked", str(theirs.fileno())]
            self.process = subprocess.Popen(
                command, cwd=ROOT, stdin=subprocess.DEVNULL, pass_fds=[theirs.fileno()], start_new_session=True
            )

    def fork(self, order: Mapping[str, object], files: Sequence[int]) -> Forked:
        """Start one process with these three standard files."""
        ours, theirs = socket.socketpair()
        with theirs:
            fds = array.array("i", [*files, theirs.fileno()])
            ancillary = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, fds)]
            self.control.sendmsg([json.dumps(order).encode()], ancillary)
        return Forked(ours)

    def close(self) -> None:
        """End it."""
        self.control.close()
        self.process.wait()


_imported: list[Imported] = []


def _the_imported() -> Imported:
    if not _imported:
        _imported.append(Imported())
        atexit.register(_imported[0].close)
    return _imported[0]


def start(
    arguments: Sequence[str],
    *,
    stdin: int | None = None,
    stdout: int,
    stderr: int,
    env: Mapping[str, str] | None = None,
    cwd: Path | None = None,
    pace: Pace | None = None,
) -> Forked:
    """Start lfs10d with these arguments; the files are descriptors."""
    order = {
        "arguments": list(arguments),
        "env": dict(os.environ if env is None else env),
        "cwd": str(cwd or Path.cwd()),
        "pace": None if pace is None else dataclasses.asdict(pace),
    }
    with Path(os.devnull).open("rb") as nothing:
        files = [nothing.fileno() if stdin is None else stdin, stdout, stderr]
        return _the_imported().fork(order, files)


def run(
    arguments: Sequence[str],
    *,
    env: Mapping[str, str] | None = None,
    cwd: Path | None = None,
    timeout: float = 60.0,
) -> subprocess.CompletedProcess[str]:
    """Run lfs10d to its end and return what it printed; TimeoutExpired after `timeout` seconds."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = start(arguments, stdout=out.fileno(), stderr=err.fileno(), env=env, cwd=cwd)
        try:
            code = process.wait(timeout)
        except subprocess.TimeoutExpired:
            process.kill()
            raise
        return subprocess.CompletedProcess(["lfs10d", *arguments], code, _content(out), _content(err))


def _content(file: IO[bytes]) -> str:
    file.seek(0)
    return file.read().decode()


# -- in the process that forks


def serve(control: socket.socket) -> list[str] | None:
    """Fork one process for each order; return the arguments in that process, None at the end of the orders.

    What runs then is killed: tests that were killed themselves leave no daemon that finds the next one's terminal.
    """
    startup.begin()
    for name in MODULES:
        importlib.import_module(name)
    gc.collect()
    gc.freeze()
    running: dict[int, socket.socket] = {}
    woken, wakes = socket.socketpair()
    wakes.settimeout(0)
    signal.set_wakeup_fd(wakes.fileno(), warn_on_full_buffer=False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    with selectors.DefaultSelector() as ready:
        ready.register(control, selectors.EVENT_READ)
        ready.register(woken, selectors.EVENT_READ)
        while True:
            found = [key.fileobj for key, _ in ready.select()]
            if woken in found:
                woken.recv(4096)
                _reap(running)
            if control in found:
                message, files, _, _ = socket.recv_fds(control, ORDER, 4)
                if not message:
                    for pid in running:
                        os.kill(pid, signal.SIGKILL)
                    return None
                if pid := os.fork():
                    running[pid] = socket.socket(fileno=files[3])
                    running[pid].send(STATUS.pack(pid))
                    for each in files[:3]:
                        os.close(each)
                    continue
                signal.set_wakeup_fd(-1)
                for kept in (control, woken, wakes, *running.values()):
                    kept.close()
                os.close(files[3])
                return _begin(json.loads(message), files[:3])


def _reap(running: dict[int, socket.socket]) -> None:
    while running:
        pid, status = os.waitpid(-1, os.WNOHANG)
        if not pid:
            return
        with running.pop(pid) as told, contextlib.suppress(OSError):  # nobody waits for it any more
            told.send(STATUS.pack(os.waitstatus_to_exitcode(status)))


def _begin(order: dict[str, Any], files: list[int]) -> list[str]:
    """Be as a process that has just been started; return its arguments."""
    for number, each in enumerate(files):
        os.dup2(each, number)
        os.close(each)
    for each in (signal.SIGCHLD, signal.SIGTERM, signal.SIGHUP):
        signal.signal(each, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    arguments: list[str] = order["arguments"]
    os.environ.clear()
    os.environ.update(order["env"])
    time.tzset()
    os.chdir(order["cwd"])
    if order["pace"] is not None:
        verb = importlib.import_module("lfs10d.cli.run")
        vars(verb)["run"] = partial(verb.run, pace=Pace(**order["pace"]))
    sys.stdin = open(0, closefd=False, encoding="utf-8")  # noqa: SIM115 - for the life of the process
    sys.stdout = _written(1)
    sys.stderr = _written(2)
    sys.argv = [str(program.__file__), *arguments]
    return arguments


def _written(number: int) -> IO[str]:
    """Return a standard file as Python opens it: standard error and a terminal go out with each line."""
    raw = "PYTHONUNBUFFERED" in os.environ
    file = open(number, "w", closefd=False, encoding="utf-8", errors="backslashreplace" if number > 1 else "strict")  # noqa: SIM115 - for the life of the process
    file.reconfigure(line_buffering=number > 1 or file.isatty(), write_through=raw)
    return file


if __name__ == "__main__" and serve(socket.socket(fileno=int(sys.argv[1]))) is not None:
    program.main()
