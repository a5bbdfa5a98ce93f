"""`lfs10d demo` as a person runs it: what is seen, how it ends, and that nothing of it is left."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import re
import signal
import socket
import struct
import subprocess
import sys
import termios
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

import pytest

PATIENCE = 60.0
"""Seconds after which something awaited counts as not happening: four interpreters start, on any machine."""
MARK = "LFS10D_TEST_OF_DEMO"
MOVING = ("mast-top", "mast-mid", "mast-low", "roof-n", "roof-s", "bridge", "harbour")


class Demo:
    """A running demo, what it printed so far, and its traces on the machine."""

    def __init__(self, folder: Path, *options: str, terminal: tuple[int, int] | None = None) -> None:
        self.folder = folder / "temporary"
        self.folder.mkdir()
        self.errors = folder / "errors"
        self.mark = uuid.uuid4().hex
        self.printed = ""
        if terminal is None:
            self._end, theirs = os.pipe()
        else:
            self._end, theirs = pty.openpty()
            fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", *terminal, 0, 0))
        variables = {"PATH": os.environ["PATH"], "TMPDIR": str(self.folder), "TERM": "xterm-256color", MARK: self.mark}
        with self.errors.open("wb") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "lfs10d", "demo", *options],
                stdin=subprocess.DEVNULL,
                stdout=theirs,
                stderr=errors,
                env={**variables, "LC_ALL": "C.UTF-8"},
            )
        os.close(theirs)
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        with contextlib.suppress(OSError):  # EIO: the other end of the terminal is closed
            while data := os.read(self._end, 4096):
                self.printed += data.decode("utf-8", "replace")
        os.close(self._end)

    def ended(self) -> tuple[int, str]:
        """Wait for its end; return exit code and standard error."""
        self.process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        return self.process.returncode, self.errors.read_text()

    def until(self, claim: Callable[[], bool], what: str) -> None:
        """Wait until `claim()` holds; it must run that long."""
        deadline = time.monotonic() + PATIENCE
        while not claim():
            assert self.process.poll() is None, f"ended: {self.errors.read_text()}"
            assert time.monotonic() < deadline, f"not within {PATIENCE:g} s: {what}"
            time.sleep(0.02)

    def left(self) -> list[str]:
        """Return the processes and files of it that are there now."""
        return [" ".join(command) for _, command in self.processes()] + [str(path) for path in self.folder.iterdir()]

    def processes(self) -> Iterator[tuple[int, list[str]]]:
        """Yield process id and command of each process it has started, itself included."""
        for entry in Path("/proc").iterdir():
            with contextlib.suppress(OSError):
                if entry.name.isdigit() and f"{MARK}={self.mark}".encode() in (entry / "environ").read_bytes():
                    yield int(entry.name), (entry / "cmdline").read_text().split("\0")

    def shown(self, name: str) -> set[str]:
        """Return what the lines have shown of a sensor: its speeds, and `-` where it had none."""
        return set(re.findall(rf"^[-\d]+ [:.\d]+ UTC  {name}  \d  ([\d.]+|-)", self.printed, re.MULTILINE))

    def moves(self, name: str) -> bool:
        """Say whether a sensor has shown different speeds."""
        return len(self.shown(name) - {"-"}) > 1


class Start(Protocol):
    """Starts the demo."""

    def __call__(self, *options: str, terminal: tuple[int, int] | None = None) -> Demo:
        """Start with these options, in a pipe or at a terminal of so many lines and columns."""


@pytest.fixture
def demo(tmp_path: Path) -> Iterator[Start]:
    """Give the function that starts the demo; what still runs afterwards is killed."""
    started: list[Demo] = []

    def start(*options: str, terminal: tuple[int, int] | None = None) -> Demo:
        started.append(Demo(tmp_path, *options, terminal=terminal))
        return started[-1]

    yield start
    for each in started:
        each.process.kill()
        each.ended()


@pytest.mark.needs("mosquitto", "mosquitto_sub")
def test_in_a_pipe_seven_sensors_move_one_is_silent_and_anybody_can_look_on_though_the_usual_port_is_taken(
    demo: Start, program: Callable[[str], str]
) -> None:
    with socket.socket() as taker:
        taker.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        with contextlib.suppress(OSError):  # somebody has it already
            taker.bind(("127.0.0.1", 1883))
            taker.listen()
        shown = demo()
        shown.until(lambda: all(map(shown.moves, MOVING)), "seven sensors show moving wind")
        shown.until(lambda: "-  offline: timeout, no answer" in shown.printed, "one is silent, and it is said why")
        assert shown.shown("crane") == {"-"}
        look_on = re.search(r"mosquitto_sub -h 127.0.0.1 -p (\d+) -t '(lfs10d/#)' -v", shown.printed)
        assert look_on is not None
        assert look_on[1] != "1883"
        heard = subprocess.run(
            [program("mosquitto_sub"), "-h", "127.0.0.1", "-p", look_on[1], "-t", look_on[2], "-v", "-C", "20"],
            capture_output=True,
            text=True,
            check=True,
            timeout=PATIENCE,
        )
        assert "lfs10d/line0/device/mast-top/" in heard.stdout
        shown.process.send_signal(signal.SIGINT)
        assert shown.ended() == (0, "")
    assert shown.left() == []
    assert "\x1b" not in shown.printed
    assert re.search(r"\d+ samples in \d+ s, 7 of 8 sensors online; nothing is left running\n\Z", shown.printed)


@pytest.mark.needs("mosquitto")
def test_at_a_terminal_it_is_a_table_on_a_screen_of_its_own_that_stays_to_be_read(demo: Start) -> None:
    shown = demo(terminal=(24, 80))
    shown.until(lambda: "timeout, no answer" in shown.printed, "the table tells why one is silent")
    shown.until(
        lambda: len(set(re.findall("harbour.*?([0-9]+[.][0-9]{2}) m/s", shown.printed))) > 1, "the last row moves"
    )
    shown.process.send_signal(signal.SIGTERM)
    assert shown.ended() == (0, "")
    assert shown.left() == []
    screen, _, after = shown.printed.rpartition("\x1b[?1049l")
    assert screen.count("\x1b[?1049h") == 1
    assert screen.count("\x1b[?25l") == screen.count("\x1b[?25h")
    assert "harbour" in after
    assert "crane is silent" in after
    assert "mosquitto_sub -h 127.0.0.1 -p " in after
    assert "nothing is left running" in after


@pytest.mark.needs("mosquitto")
def test_at_a_small_terminal_it_is_the_table_alone(demo: Start) -> None:
    shown = demo("--for", "1.5s", terminal=(12, 80))
    assert shown.ended() == (0, "")
    assert "a taller window shows them" in shown.printed
    assert "crane is silent" not in shown.printed


def test_with_the_broker_that_comes_with_python_it_is_the_same(demo: Start) -> None:
    shown = demo("--broker", "amqtt")
    shown.until(lambda: all(map(shown.moves, MOVING)), "seven sensors show moving wind")
    shown.process.send_signal(signal.SIGTERM)
    assert shown.ended() == (0, "")
    assert "amqtt (MQTT 3.1.1, 127.0.0.1:" in shown.printed
    assert shown.left() == []


@pytest.mark.needs("mosquitto")
def test_killed_it_leaves_neither_process_nor_file(demo: Start) -> None:
    shown = demo()
    shown.until(lambda: shown.shown("mast-top") != set(), "it shows something")
    # One that is just being started is there twice for a moment.
    shown.until(lambda: len(list(shown.processes())) == 6, "demo, caretaker, simulator, broker, page and daemon")
    shown.process.kill()
    assert shown.ended() == (-signal.SIGKILL, "")
    deadline = time.monotonic() + PATIENCE
    while shown.left() and time.monotonic() < deadline:
        time.sleep(0.02)
    assert shown.left() == []


@pytest.mark.needs("mosquitto")
def test_if_the_daemon_ends_it_says_so_and_ends_too(demo: Start) -> None:
    shown = demo()
    shown.until(lambda: shown.shown("mast-top") != set(), "it shows something")
    daemon = next(process for process, command in shown.processes() if "run" in command)
    os.kill(daemon, signal.SIGKILL)
    code, errors = shown.ended()
    assert code == 1
    assert errors.startswith("lfs10d: the demo's daemon has ended: ")
    assert shown.left() == []


def test_a_duration_that_is_none_is_refused(demo: Start) -> None:
    code, errors = demo("--for", "soon").ended()
    assert code == 2
    assert "'soon' is not a duration; write 10s or 2m" in errors
