"""A port that cannot be opened: busy, forbidden, none at all, or with a driver that refuses."""

from __future__ import annotations

import errno
import fcntl
import os
import subprocess
import termios
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from lfs10d.errors import PortBusyError, PortError, PortLostError
from lfs10d.modbus import port as module
from lfs10d.modbus import port_lock
from lfs10d.modbus.port import SerialPort
from lfs10d.modbus.port_settings import PortSettings
from tests.support.far_end import FarEnd

NOBODY = 65534


@contextmanager
def unprivileged() -> Iterator[None]:
    """Act as nobody for a while, if the tests run as root."""
    root = os.geteuid() == 0
    if root:
        os.seteuid(NOBODY)
    try:
        yield
    finally:
        if root:
            os.seteuid(0)


def refused(settings: PortSettings) -> PortError:
    """Return why the port could not be opened, and see that nothing of the attempt is left open."""
    port = SerialPort(settings)
    before = len(os.listdir("/proc/self/fd"))  # noqa: PTH208 - descriptors are counted, not visited
    with pytest.raises(PortError) as caught:
        port.open()
    assert port.fileno() == -1
    assert len(os.listdir("/proc/self/fd")) == before  # noqa: PTH208 - as above
    return caught.value


def test_a_port_that_is_open_is_busy_for_the_next(port: SerialPort) -> None:
    error = refused(port.settings)

    assert isinstance(error, PortBusyError)
    assert "end that, or free the port there" in error.message


def test_a_busy_port_names_who_holds_it_and_is_free_afterwards(far_end: FarEnd) -> None:
    settings = PortSettings(far_end.path)
    with subprocess.Popen(
        ["flock", "--no-fork", far_end.path, "sh", "-c", "echo held; read end"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as holding:
        assert holding.stdout is not None
        assert holding.stdout.readline() == b"held\n"
        error = refused(settings)
        assert isinstance(error, PortBusyError)
        assert error.message == f"in use by sh (process {holding.pid}): end that, or free the port there"
        holding.communicate(b"\n")

    port = SerialPort(settings)
    port.open()
    assert port.fileno() >= 0
    port.close()


def test_who_holds_a_busy_port_is_looked_for_once_while_it_stays_busy(
    port: SerialPort, far_end: FarEnd, monkeypatch: pytest.MonkeyPatch
) -> None:
    searches: list[str] = []
    monkeypatch.setattr(module, "holder", searches.append)
    second = SerialPort(port.settings)
    for _ in range(3):
        with pytest.raises(PortBusyError):
            second.open()
    assert searches == [far_end.path]

    second.settings = PortSettings("/dev/no-such-port")
    with pytest.raises(PortLostError):
        second.open()
    second.settings = port.settings
    with pytest.raises(PortBusyError):
        second.open()
    assert searches == [far_end.path] * 2


def test_a_port_made_exclusive_by_another_program_is_busy(far_end: FarEnd) -> None:
    os.chmod(far_end.path, 0o666)  # noqa: PTH101, S103 - the test's own pty
    other = os.open(far_end.path, os.O_RDWR | os.O_NOCTTY)
    fcntl.ioctl(other, termios.TIOCEXCL)

    with unprivileged():
        assert isinstance(refused(PortSettings(far_end.path)), PortBusyError)

    os.close(other)


def test_the_locks_of_who_uses_a_port_survive_our_attempt(far_end: FarEnd, monkeypatch: pytest.MonkeyPatch) -> None:
    """Root passes TIOCEXCL, and could take the flag away from its owner."""
    monkeypatch.setattr(port_lock, "is_pty", lambda _fd: False)
    other = os.open(far_end.path, os.O_RDWR | os.O_NOCTTY)
    fcntl.ioctl(other, termios.TIOCEXCL)

    assert isinstance(refused(PortSettings(far_end.path)), PortBusyError)

    raw = bytearray(4)
    fcntl.ioctl(other, port_lock.TIOCGEXCL, raw)
    assert any(raw)
    os.close(other)


def test_a_forbidden_port_says_which_group_may_use_it(far_end: FarEnd) -> None:
    os.chmod(far_end.path, 0o000)  # noqa: PTH101 - the test's own pty

    with unprivileged():
        error = refused(PortSettings(far_end.path))

    assert isinstance(error, PortLostError)
    assert "permission denied" in error.message
    assert "dialout" in error.message


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("/dev/no-such-port", "there is no such device: is the adapter plugged in"),
        ("/dev/null", "is no serial port"),
        ("/dev/null/ttyUSB0", "there is no such device"),
        ("/dev/tty", "is no serial port"),
        ("/dev", "is a directory"),
        ("", "is a directory"),
        ("/dev/tty\0USB0", "is no path of a device"),
        ("/dev/" + "x" * 300, "is no path of a device"),
        ("/dev/tty\udc80", "there is no such device"),
    ],
)
def test_what_is_no_port_is_refused_with_what_to_do(path: str, words: str) -> None:
    error = refused(PortSettings(path))

    assert isinstance(error, PortLostError)
    assert words in error.message


def test_a_regular_file_and_a_fifo_are_no_ports(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    os.mkfifo(tmp_path / "fifo")

    for name in ("file", "fifo"):
        assert "is no serial port" in refused(PortSettings(str(tmp_path / name))).message


def test_links_in_a_circle_are_named_so(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")

    assert "links lead in a circle" in refused(PortSettings(str(tmp_path / "a"))).message


def as_a_uart(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a pty judged as if it had a wire."""
    monkeypatch.setattr(module, "is_pty", lambda _fd: False)


def test_a_driver_that_does_not_take_the_settings_is_a_lost_port(
    far_end: FarEnd, monkeypatch: pytest.MonkeyPatch
) -> None:
    as_a_uart(monkeypatch)

    error = refused(PortSettings(far_end.path, parity="even", databits=7))

    assert error.message == (
        "the driver did not take 7 data bits, parity even: choose what the adapter can do, or another adapter"
    )


def test_a_driver_that_keeps_another_rate_is_a_lost_port(port: SerialPort, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(termios, "tcsetattr", lambda *_: None)
    before = port.settings

    with pytest.raises(PortLostError, match=r"did not take 115200 baud \(it says 9600\)"):
        port.reconfigure(PortSettings(before.path, baudrate=115200))

    assert port.settings == before


def test_a_library_that_says_a_bit_did_not_stick_is_asked_which(
    port: SerialPort, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some C libraries answer EINVAL when a pty drops the parity though the rate was set."""
    real = termios.tcsetattr

    def strict(fd: int, when: int, wanted: list[int | list[bytes | int]]) -> None:
        real(fd, when, wanted)
        raise termios.error(errno.EINVAL, "Invalid argument")

    monkeypatch.setattr(termios, "tcsetattr", strict)
    even = PortSettings(port.settings.path, baudrate=19200, parity="even", databits=7)

    port.reconfigure(even)

    assert port.settings == even


def test_a_port_that_hangs_up_while_it_is_set_is_a_lost_port(far_end: FarEnd, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise termios.error(errno.EIO, "Input/output error")

    monkeypatch.setattr(termios, "tcsetattr", fail)

    assert "no hardware answers behind it" in refused(PortSettings(far_end.path)).message


@pytest.mark.parametrize(
    ("major", "minor", "console"),
    [(4, 0, True), (4, 63, True), (4, 64, False), (5, 0, True), (5, 1, True), (188, 0, False), (204, 64, False)],
)
def test_a_console_is_no_port(major: int, minor: int, *, console: bool) -> None:
    assert module._is_console(os.makedev(major, minor)) == console
