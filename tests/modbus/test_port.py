"""The serial port on real ptys: opened, locked, written, read, set, pulled out."""

from __future__ import annotations

import errno
import os
import subprocess
import termios
from pathlib import Path

import pytest

from lfs10d.errors import PortLostError
from lfs10d.modbus.port import Port, SerialPort
from lfs10d.modbus.port_settings import PortSettings, Rs485
from lfs10d.schema.quantities import BAUDRATES
from tests.support.far_end import FarEnd
from tests.support.ports import FRAME, PATIENCE, readable


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
