"""An open port that hangs up, errs or takes nothing is a lost port."""

from __future__ import annotations

import errno
import fcntl
import os
import termios

import pytest

from lfs10d.errors import PortLostError
from lfs10d.modbus.port import SerialPort
from lfs10d.modbus.port_settings import PortSettings
from tests.support.far_end import FarEnd
from tests.support.ports import FRAME, readable


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
