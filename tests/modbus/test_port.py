"""The serial port on real ptys: opened, locked, written, read, set, pulled out."""

from __future__ import annotations

import errno
import fcntl
import os
import select
import subprocess
import termios
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from lfs10d.errors import PortBusyError, PortError, PortLostError
from lfs10d.modbus import port as module
from lfs10d.modbus import port_lock
from lfs10d.modbus.port import Port, SerialPort
from lfs10d.modbus.port_settings import PortSettings, Rs485
from lfs10d.schema.quantities import BAUDRATES
from tests.support.far_end import FarEnd

FRAME = bytes.fromhex("01 03 00 01 00 02 95 CB")
NOBODY = 65534
PATIENCE = 10.0


@pytest.fixture
def port(far_end: FarEnd) -> Iterator[SerialPort]:
    """Give an open port."""
    opened = SerialPort(PortSettings(far_end.path))
    opened.open()
    yield opened
    opened.close()


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


def readable(fd: int, within: float = PATIENCE) -> bool:
    """Wait until the descriptor is readable."""
    return bool(select.select([fd], [], [], within)[0])


def test_a_serial_port_is_a_port(far_end: FarEnd) -> None:
    port: Port = SerialPort(PortSettings(far_end.path))

    assert port.settings.path == far_end.path
    assert port.fileno() == -1


def test_a_frame_crosses_the_port_both_ways_unchanged(port: SerialPort, far_end: FarEnd) -> None:
    every_byte = bytes(range(256))

    port.write(every_byte)
    assert os.read(far_end.fd, 4096) == every_byte

    os.write(far_end.fd, every_byte)
    assert readable(port.fileno())
    assert port.waiting() == 256
    assert port.read() == every_byte


def test_a_frame_is_one_write(port: SerialPort, monkeypatch: pytest.MonkeyPatch) -> None:
    writes: list[bytes] = []

    def write(_fd: int, data: bytes) -> int:
        writes.append(data)
        return len(data)

    monkeypatch.setattr(os, "write", write)
    port.write(FRAME)

    assert writes == [FRAME]


def test_where_nothing_is_there_a_read_returns_at_once(port: SerialPort) -> None:
    assert port.read() == b""
    assert port.waiting() == 0


@pytest.mark.parametrize("baudrate", BAUDRATES)
def test_the_rate_is_really_set(far_end: FarEnd, baudrate: int) -> None:
    port = SerialPort(PortSettings(far_end.path, baudrate=baudrate, parity="odd", databits=7, stopbits=2))
    port.open()

    found = termios.tcgetattr(far_end.fd)

    speed = getattr(termios, f"B{baudrate}")
    assert found[4:6] == [speed, speed]
    assert found[2] & termios.CSTOPB  # what a pty keeps of the rest
    assert found[2] & termios.PARODD
    port.close()


def test_the_rate_is_changed_on_the_open_port_and_no_byte_is_lost(port: SerialPort, far_end: FarEnd) -> None:
    port.write(FRAME)
    os.write(far_end.fd, b"\x01\x03")
    faster = PortSettings(far_end.path, baudrate=19200)

    port.reconfigure(faster)

    assert termios.tcgetattr(far_end.fd)[4:6] == [termios.B19200, termios.B19200]
    assert port.settings == faster
    assert os.read(far_end.fd, 100) == FRAME
    assert readable(port.fileno())
    assert port.read() == b"\x01\x03"


def test_a_drained_port_has_sent_everything(port: SerialPort, far_end: FarEnd) -> None:
    port.write(FRAME)

    port.drain()

    assert os.read(far_end.fd, 100) == FRAME


def test_a_drain_cut_short_by_a_signal_goes_on(port: SerialPort, monkeypatch: pytest.MonkeyPatch) -> None:
    answers: list[Exception | None] = [termios.error(errno.EINTR, "Interrupted system call"), None]

    def drain(_fd: int) -> None:
        answer = answers.pop(0)
        if answer:
            raise answer

    monkeypatch.setattr(termios, "tcdrain", drain)
    port.drain()

    assert answers == []


def test_a_flushed_port_has_forgotten_what_was_heard(port: SerialPort, far_end: FarEnd) -> None:
    os.write(far_end.fd, b"noise")
    assert readable(port.fileno())

    port.flush()
    os.write(far_end.fd, b"answer")

    assert readable(port.fileno())
    assert port.read() == b"answer"


def test_what_came_before_the_opening_is_forgotten(far_end: FarEnd) -> None:
    os.write(far_end.fd, b"old")
    port = SerialPort(PortSettings(far_end.path))

    port.open()

    assert port.waiting() == 0
    port.close()


def test_a_pty_counts_no_errors_and_confirms_no_low_latency(port: SerialPort) -> None:
    assert port.counters() is None
    assert port.adapter_latency == 0.020
    assert not port.paced
    assert port.notices == ()


def test_a_driver_without_rs485_opens_all_the_same_with_a_notice(far_end: FarEnd) -> None:
    port = SerialPort(PortSettings(far_end.path, rs485=Rs485()))

    port.open()

    assert len(port.notices) == 1
    assert "has no RS485 mode" in port.notices[0]
    port.close()


def test_an_opening_begins_anew_and_forgets_what_the_one_before_had_to_say(far_end: FarEnd) -> None:
    port = SerialPort(PortSettings(far_end.path, rs485=Rs485()))
    port.open()
    before = port.notices
    port.settings = PortSettings(far_end.path)

    port.open()

    assert len(before) == 1
    assert port.notices == ()
    port.close()


def test_a_pulled_plug_is_noticed_by_a_read_at_once(port: SerialPort, far_end: FarEnd) -> None:
    far_end.close()

    assert readable(port.fileno(), within=0)
    with pytest.raises(PortLostError, match=r"hung up.*plug it in again"):
        port.read()


def test_an_empty_read_of_a_hung_up_port_is_a_hang_up(
    port: SerialPort, far_end: FarEnd, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A UART's hang-up reads as nothing, readable for ever: the trap that eats a processor."""
    far_end.close()
    monkeypatch.setattr(os, "read", lambda _fd, _size: b"")

    with pytest.raises(PortLostError, match="hung up: the adapter was unplugged"):
        port.read()


def test_a_pulled_plug_is_noticed_by_a_write(port: SerialPort, far_end: FarEnd) -> None:
    far_end.close()

    with pytest.raises(PortLostError, match=r"hung up \(Input/output error\)"):
        port.write(FRAME)


@pytest.mark.parametrize("code", [errno.EIO, errno.ENODEV])
def test_an_error_of_any_call_on_the_open_port_is_a_lost_port(
    port: SerialPort, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    def fail(*_: object) -> int:
        raise OSError(code, os.strerror(code))

    def fail_in_termios(*_: object) -> int:
        raise termios.error(code, os.strerror(code))

    monkeypatch.setattr(os, "read", fail)
    monkeypatch.setattr(fcntl, "ioctl", fail)
    for name in ("tcdrain", "tcflush", "tcgetattr"):
        monkeypatch.setattr(termios, name, fail_in_termios)
    calls = (port.read, port.waiting, port.drain, port.flush, lambda: port.reconfigure(port.settings))
    for call in calls:
        with pytest.raises(PortLostError) as caught:
            call()
        assert os.strerror(code) in caught.value.message
    monkeypatch.undo()


def test_every_call_on_a_closed_port_is_a_lost_port(far_end: FarEnd) -> None:
    port = SerialPort(PortSettings(far_end.path))
    calls = (
        port.read,
        port.waiting,
        port.drain,
        port.flush,
        lambda: port.write(FRAME),
        lambda: port.reconfigure(port.settings),
    )
    for call in calls:
        with pytest.raises(PortLostError, match="Bad file descriptor"):
            call()
    assert port.counters() is None


def test_a_port_is_closed_twice_without_a_word(port: SerialPort, far_end: FarEnd) -> None:
    far_end.close()

    port.close()
    port.close()

    assert port.fileno() == -1


def test_a_far_end_that_takes_nothing_is_a_lost_port_not_half_a_frame(port: SerialPort, far_end: FarEnd) -> None:
    with pytest.raises(PortLostError, match=r"the driver took \d+ of 1000 bytes of a frame"):  # noqa: PT012 - when is the system's affair
        while True:
            port.write(bytes(1000))

    while readable(far_end.fd, within=0):
        os.read(far_end.fd, 4096)
    port.write(FRAME)
    assert readable(far_end.fd)


def test_a_port_full_to_the_last_byte_is_a_lost_port_too(port: SerialPort, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> int:
        raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")

    monkeypatch.setattr(os, "write", full)

    with pytest.raises(PortLostError, match="took 0 of 8 bytes"):
        port.write(FRAME)


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


def test_an_adapter_that_comes_back_as_another_device_is_found_by_its_link(tmp_path: Path) -> None:
    link = tmp_path / "by-id"
    port = SerialPort(PortSettings(str(link)))
    for _ in range(2):
        master, slave = os.openpty()
        link.symlink_to(os.ttyname(slave))
        os.close(slave)
        port.open()
        port.write(FRAME)
        assert os.read(master, 100) == FRAME

        os.close(master)
        with pytest.raises(PortLostError):
            port.read()
        with pytest.raises(PortLostError, match=r"the link leads to .*, which is not there"):
            port.open()
        link.unlink()


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


@pytest.mark.needs("socat")
def test_bytes_cross_a_line_of_socat_until_it_ends(tmp_path: Path) -> None:
    near, far = tmp_path / "near", tmp_path / "far"
    with subprocess.Popen(
        ["socat", "-d", "-d", f"pty,raw,echo=0,link={near}", f"pty,raw,echo=0,link={far}"],
        stderr=subprocess.PIPE,
    ) as line:
        assert line.stderr is not None
        while b"starting data transfer" not in line.stderr.readline():
            assert line.poll() is None
        one, other = SerialPort(PortSettings(str(near))), SerialPort(PortSettings(str(far)))
        one.open()
        other.open()

        one.write(FRAME)
        assert readable(other.fileno())
        assert other.read() == FRAME

        line.terminate()
        line.wait(PATIENCE)
        for port in (one, other):
            assert readable(port.fileno())
            with pytest.raises(PortLostError):
                port.read()
            port.close()
