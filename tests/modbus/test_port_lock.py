"""Locks of a port and who holds them; processes and locks are real, /proc is also played."""

from __future__ import annotations

import errno
import fcntl
import os
import subprocess
import sys
import termios
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus import port_lock
from lfs10d.modbus.port_lock import TIOCGEXCL, Holder, claim, holder, is_pty, locked_by, program_name, release
from tests.support.far_end import FarEnd

LOCKING = """
import fcntl, os, sys
fd = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
if sys.argv[2] == "flock":
    fcntl.flock(fd, fcntl.LOCK_EX)
print("held", flush=True)
sys.stdin.read()
"""


@contextmanager
def another_process(path: str, how: str, script: Path) -> Iterator[int]:
    """Have another process hold the port, by flock or just open; gives its id."""
    script.write_text(LOCKING)
    with subprocess.Popen(
        [sys.executable, "-S", str(script), path, how], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"held\n"
        yield process.pid


@pytest.fixture
def tty(far_end: FarEnd) -> Iterator[int]:
    """Give the near end of a pty."""
    fd = os.open(far_end.path, os.O_RDWR | os.O_NOCTTY)
    yield fd
    os.close(fd)


def exclusive(fd: int) -> bool:
    """Ask the kernel whether the terminal is exclusive."""
    raw = bytearray(4)
    fcntl.ioctl(fd, TIOCGEXCL, raw)
    return any(raw)


def test_a_claimed_port_is_locked_for_everybody_else(far_end: FarEnd, tty: int) -> None:
    other = os.open(far_end.path, os.O_RDWR | os.O_NOCTTY)

    assert claim(tty)
    assert not claim(other)
    release(tty)
    assert claim(other)
    os.close(other)


def test_a_pty_is_not_made_exclusive_for_the_flag_would_outlive_a_killed_process(tty: int) -> None:
    assert is_pty(tty)
    assert claim(tty)
    assert not exclusive(tty)


def test_a_uart_is_made_exclusive_until_it_is_released(tty: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(port_lock, "is_pty", lambda _fd: False)

    assert claim(tty)
    assert exclusive(tty)
    release(tty)
    assert not exclusive(tty)


def test_an_exclusive_uart_is_busy_for_root_too(tty: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(port_lock, "is_pty", lambda _fd: False)
    fcntl.ioctl(tty, termios.TIOCEXCL)

    assert not claim(tty)


def test_an_exclusive_flag_left_on_a_pty_by_a_dead_process_holds_nobody_up(tty: int) -> None:
    fcntl.ioctl(tty, termios.TIOCEXCL)

    assert claim(tty)


def test_an_exclusive_pty_that_a_process_has_open_is_busy(far_end: FarEnd, tty: int, tmp_path: Path) -> None:
    with another_process(far_end.path, "open", tmp_path / "picocom"):
        fcntl.ioctl(tty, termios.TIOCEXCL)
        assert not claim(tty)


def test_what_is_no_terminal_cannot_be_claimed(tmp_path: Path) -> None:
    fd = os.open(tmp_path / "file", os.O_RDWR | os.O_CREAT)

    with pytest.raises(OSError, match="Inappropriate ioctl") as caught:
        claim(fd)

    assert caught.value.errno == errno.ENOTTY
    os.close(fd)


def test_a_lock_that_fails_for_another_reason_is_told() -> None:
    with pytest.raises(OSError, match="Bad file descriptor"):
        claim(2**20)


def test_a_port_that_is_gone_is_released_without_a_word() -> None:
    release(2**20)

    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(2**20)


def test_the_holder_of_the_lock_is_found_by_its_lock(far_end: FarEnd, tmp_path: Path) -> None:
    with another_process(far_end.path, "flock", tmp_path / "mbpoll") as pid:
        found = holder(far_end.path)

    assert found == Holder(pid, "mbpoll")
    assert str(found) == f"mbpoll (process {pid})"


def test_the_holder_without_a_lock_is_found_by_its_open_file(far_end: FarEnd, tmp_path: Path) -> None:
    with another_process(far_end.path, "open", tmp_path / "picocom") as pid:
        assert holder(far_end.path) == Holder(pid, "picocom")


def test_a_port_that_only_we_have_open_has_no_other_holder(far_end: FarEnd, tty: int) -> None:
    assert claim(tty)

    assert holder(far_end.path) is None


@pytest.mark.parametrize("path", ["/dev/no-such-port", "zero\0byte"])
def test_a_path_that_is_not_there_has_no_holder(path: str) -> None:
    assert holder(path) is None


def test_without_proc_nobody_is_named(far_end: FarEnd, tmp_path: Path) -> None:
    assert holder(far_end.path, proc=tmp_path / "nothing") is None


def test_a_holder_whose_name_is_hidden_is_named_by_its_number(far_end: FarEnd, tmp_path: Path) -> None:
    status = os.stat(far_end.path)  # noqa: PTH116 - what the kernel says, not what we ask
    place = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}:{status.st_ino}"
    (tmp_path / "locks").write_text(f"1: FLOCK  ADVISORY  WRITE 4711 {place} 0 EOF\n")

    assert str(holder(far_end.path, proc=tmp_path)) == "process 4711"


def test_a_hostile_program_name_is_escaped(far_end: FarEnd, tmp_path: Path) -> None:
    process = tmp_path / "4711"
    (process / "fd").mkdir(parents=True)
    (process / "fd" / "3").symlink_to(far_end.path)
    (process / "fd" / "4").symlink_to("/dev/no-such-device")
    (process / "comm").write_text("evil\x1b[2J\n")
    (process / "cmdline").write_bytes(b"evil\0")
    (tmp_path / "self").mkdir()

    assert holder(far_end.path, proc=tmp_path) == Holder(4711, "evil\\x1b[2J")


LOCKS = """\
1: POSIX  ADVISORY  WRITE 100 00:05:94 0 EOF
2: FLOCK  ADVISORY  READ 101 00:05:94 0 EOF
3: FLOCK  ADVISORY  WRITE 102 00:05:95 0 EOF
4: FLOCK  ADVISORY  WRITE 0 00:05:94 0 EOF
5: FLOCK  ADVISORY  WRITE 103 00:05:94 0 EOF
5: -> FLOCK  ADVISORY  WRITE 104 00:05:94 0 EOF
"""


def test_the_holder_is_the_writer_of_the_flock_on_that_very_file() -> None:
    assert locked_by(LOCKS, os.makedev(0, 5), 94) == 103
    assert locked_by(LOCKS, os.makedev(0, 5), 95) == 102
    assert locked_by(LOCKS, os.makedev(0, 5), 96) is None
    assert locked_by(LOCKS, os.makedev(0, 0x1A), 94) is None


def test_who_waits_for_a_lock_does_not_hold_it() -> None:
    assert locked_by("5: -> FLOCK  ADVISORY  WRITE 104 00:05:94 0 EOF\n", os.makedev(0, 5), 94) is None


@given(st.text())
def test_no_text_of_locks_is_too_odd(text: str) -> None:
    assert locked_by(text, os.makedev(0, 5), 94) is None


@pytest.mark.parametrize(
    ("comm", "argv", "name"),
    [
        ("mbpoll", ["mbpoll", "-m", "rtu"], "mbpoll"),
        ("python3", ["python3", "/opt/bin/lfs10d", "run"], "lfs10d"),
        ("python3.11", ["python", "-I", "-X", "dev", "-m", "lfs10d", "run"], "lfs10d"),
        ("python3", ["python3", "-m"], "python3"),
        ("python3", ["python3", "-W"], "python3"),
        ("python3", ["python3", "-c", "import serial", ""], "python3"),
        ("python3", ["python3", ""], "python3"),
        ("python3", [""], "python3"),
    ],
)
def test_an_interpreter_is_called_by_what_it_runs(comm: str, argv: list[str], name: str) -> None:
    assert program_name(comm, argv) == name
