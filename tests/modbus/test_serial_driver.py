"""What a driver can do beyond termios: against a driver played here, and a real pty that can do nothing."""

from __future__ import annotations

import errno
import fcntl
import os
import struct
import termios
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus import serial_driver
from lfs10d.modbus.port_settings import Rs485
from lfs10d.modbus.serial_driver import (
    ASYNC_LOW_LATENCY,
    TIOCGRS485,
    TIOCSRS485,
    lower_latency,
    read_counters,
    rs485_struct,
    switch_rs485,
)
from lfs10d.reading import UartCounters
from tests.support.far_end import FarEnd


@dataclass
class Driver:
    """A driver in memory: structures by the request that reads them, errno by the request that is refused."""

    structures: dict[int, bytes] = field(default_factory=dict)
    refused: dict[int, int] = field(default_factory=dict)
    asked: list[int] = field(default_factory=list)
    changes: bytes | None = None
    """What the driver makes of the RS485 settings; None takes them as they are."""

    def ioctl(self, _fd: int, request: int, raw: bytearray) -> int:
        """Answer as the kernel would: into the buffer, or by OSError."""
        self.asked.append(request)
        if request in self.refused:
            raise OSError(self.refused[request], os.strerror(self.refused[request]))
        if request == termios.TIOCSSERIAL:
            self.structures[termios.TIOCGSERIAL] = bytes(raw)
        elif request == TIOCSRS485:
            self.structures[TIOCGRS485] = bytes(raw) if self.changes is None else self.changes
            raw[:] = self.structures[TIOCGRS485]
        else:
            content = self.structures[request]
            raw[: len(content)] = content
        return 0

    @property
    def flags(self) -> int:
        """The flags of its struct serial_struct, the fifth int."""
        return int(struct.unpack_from("@5i", self.structures[termios.TIOCGSERIAL])[4])


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> Driver:
    """Give a driver that answers instead of the kernel."""
    player = Driver(structures={termios.TIOCGSERIAL: struct.pack("@5i", 4, 0, 0, 17, 0x40)})
    monkeypatch.setattr(fcntl, "ioctl", player.ioctl)
    return player


@pytest.fixture
def tty(far_end: FarEnd) -> Iterator[int]:
    """Give the near end of a pty."""
    fd = os.open(far_end.path, os.O_RDWR | os.O_NOCTTY)
    yield fd
    os.close(fd)


def knob(sysfs: Path, fd: int, name: str, content: str) -> Path:
    """Make a file that sysfs would have for the device."""
    number = os.fstat(fd).st_rdev
    path = sysfs / "dev" / "char" / f"{os.major(number)}:{os.minor(number)}" / name
    path.parent.mkdir(parents=True)
    path.write_text(content)
    return path


def test_a_pty_has_no_low_latency_mode_and_nobody_is_told(tty: int) -> None:
    assert lower_latency(tty, wanted=True) == serial_driver.Latency(0.020)


def test_an_ftdi_timer_of_1_ms_confirms_low_latency(played: Driver, tty: int, tmp_path: Path) -> None:
    timer = knob(tmp_path, tty, "device/latency_timer", "16\n")

    assert lower_latency(tty, wanted=True, sysfs=tmp_path) == serial_driver.Latency(0.004)
    assert timer.read_text() == "1"
    assert played.flags == 0x40 | ASYNC_LOW_LATENCY  # the other flags stay


def test_a_uart_that_interrupts_at_each_byte_confirms_low_latency(played: Driver, tty: int, tmp_path: Path) -> None:
    knob(tmp_path, tty, "rx_trig_bytes", "8\n")

    assert lower_latency(tty, wanted=True, sysfs=tmp_path) == serial_driver.Latency(0.004)
    assert termios.TIOCSSERIAL in played.asked


def test_the_flag_alone_confirms_nothing(played: Driver, tty: int, tmp_path: Path) -> None:
    assert lower_latency(tty, wanted=True, sysfs=tmp_path) == serial_driver.Latency(0.020)
    assert played.flags & ASYNC_LOW_LATENCY


def test_a_flag_that_is_set_is_not_set_again(played: Driver, tty: int, tmp_path: Path) -> None:
    played.structures[termios.TIOCGSERIAL] = struct.pack("@5i", 4, 0, 0, 17, ASYNC_LOW_LATENCY)

    lower_latency(tty, wanted=True, sysfs=tmp_path)

    assert played.asked == [termios.TIOCGSERIAL]


@pytest.mark.usefixtures("played")
def test_a_timer_that_cannot_be_set_is_told_with_what_to_do(
    tty: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    timer = knob(tmp_path, tty, "device/latency_timer", "16\n")

    def refuse(*_: object, **__: object) -> int:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(type(timer), "write_text", refuse)
    latency = lower_latency(tty, wanted=True, sysfs=tmp_path)

    assert latency.adapter == 0.020
    assert latency.notice == (
        "the adapter holds bytes back, latency_timer is 16 milliseconds (FTDI) and could not be set to 1 "
        f"(Permission denied): polls take longer; as root: echo 1 > {timer}, or a udev rule that does it"
    )


@pytest.mark.usefixtures("played")
def test_a_timer_that_takes_the_value_in_silence_and_keeps_its_own_is_told_too(
    tty: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    timer = knob(tmp_path, tty, "device/latency_timer", "16\n")
    monkeypatch.setattr(type(timer), "write_text", lambda *_, **__: 1)

    notice = lower_latency(tty, wanted=True, sysfs=tmp_path).notice

    assert notice is not None
    assert "latency_timer is 16 milliseconds (FTDI) and could not be set to 1: polls take longer" in notice


@pytest.mark.usefixtures("played")
def test_a_timer_that_says_no_number_confirms_nothing(tty: int, tmp_path: Path) -> None:
    knob(tmp_path, tty, "device/latency_timer", "soon\n")

    assert lower_latency(tty, wanted=True, sysfs=tmp_path) == serial_driver.Latency(0.020)


@pytest.mark.parametrize("code", [errno.EPERM, errno.EIO])
def test_a_refused_flag_is_told_unless_the_timer_is_short_anyway(
    played: Driver, tty: int, tmp_path: Path, code: int
) -> None:
    played.refused[termios.TIOCSSERIAL] = code

    refused = lower_latency(tty, wanted=True, sysfs=tmp_path)
    assert refused == serial_driver.Latency(0.020, f"the driver refuses its low-latency mode ({os.strerror(code)})")

    knob(tmp_path, tty, "device/latency_timer", "1\n")
    assert lower_latency(tty, wanted=True, sysfs=tmp_path) == serial_driver.Latency(0.004)


def test_where_low_latency_is_not_wanted_nothing_is_changed(played: Driver, tty: int, tmp_path: Path) -> None:
    timer = knob(tmp_path, tty, "device/latency_timer", "16\n")

    assert lower_latency(tty, wanted=False, sysfs=tmp_path) == serial_driver.Latency(0.020)
    assert timer.read_text() == "16\n"
    assert played.asked == []


@pytest.mark.usefixtures("played")
def test_low_latency_that_somebody_else_set_counts(tty: int, tmp_path: Path) -> None:
    knob(tmp_path, tty, "device/latency_timer", "1\n")

    assert lower_latency(tty, wanted=False, sysfs=tmp_path) == serial_driver.Latency(0.004)


def words(raw: bytes) -> tuple[int, ...]:
    """Take struct serial_rs485 apart."""
    return struct.unpack("@8I", raw)


def test_the_rs485_structure_is_the_kernels() -> None:
    wanted = Rs485(rts_on_send=True, rts_after_send=False, delay_before_send=0.002, delay_after_send=0.0001)

    assert words(rs485_struct(wanted, bytes(32))) == (0b011, 2, 1, 0, 0, 0, 0, 0)


def test_the_rs485_levels_may_be_swapped() -> None:
    wanted = Rs485(rts_on_send=False, rts_after_send=True)

    assert words(rs485_struct(wanted, struct.pack("@8I", 0b011, 9, 9, 0, 0, 0, 0, 0)))[:3] == (0b101, 0, 0)


def test_rs485_flags_that_are_not_ours_are_kept() -> None:
    terminated = struct.pack("@8I", 0b110000, 0, 0, 5, 6, 7, 8, 9)

    assert words(rs485_struct(Rs485(), terminated)) == (0b110011, 0, 0, 5, 6, 7, 8, 9)


@given(milliseconds=st.integers(0, 1000))
def test_a_delay_of_whole_milliseconds_is_not_rounded_up(milliseconds: int) -> None:
    wanted = Rs485(delay_before_send=milliseconds / 1000, delay_after_send=milliseconds / 1000)

    assert words(rs485_struct(wanted, bytes(32)))[1:3] == (milliseconds, milliseconds)


@pytest.fixture
def rs485(played: Driver) -> Driver:
    """Give a driver with an RS485 mode."""
    played.structures[TIOCGRS485] = bytes(32)
    return played


def test_the_driver_is_switched_to_rs485(rs485: Driver) -> None:
    assert switch_rs485(0, Rs485(delay_before_send=0.001)) is None
    assert words(rs485.structures[TIOCGRS485])[:3] == (0b011, 1, 0)


def test_a_driver_that_changes_the_rs485_settings_is_told(rs485: Driver) -> None:
    rs485.changes = struct.pack("@8I", 0b011, 100, 0, 0, 0, 0, 0, 0)

    assert switch_rs485(0, Rs485(delay_before_send=0.5)) == (
        "the driver changed the RS485 settings asked for: it is on, rts_on_send true, rts_after_send false, "
        "delay_before_send 100 ms, delay_after_send 0 ms"
    )


def test_a_driver_that_leaves_rs485_off_is_told(rs485: Driver) -> None:
    rs485.changes = bytes(32)

    assert "it is off" in str(switch_rs485(0, Rs485()))


def test_a_pty_without_rs485_is_told_and_does_not_fail(tty: int) -> None:
    assert switch_rs485(tty, Rs485()) == (
        "the driver has no RS485 mode: the adapter must switch its direction by itself; remove line.rs485 if it does"
    )


def test_a_refused_rs485_mode_says_why(rs485: Driver) -> None:
    rs485.refused[TIOCSRS485] = errno.EPERM

    assert "refuses its RS485 mode (Operation not permitted)" in str(switch_rs485(0, Rs485()))


def test_the_counters_of_the_driver_are_read_by_name(played: Driver) -> None:
    # cts dsr rng dcd rx tx frame overrun parity brk buf_overrun
    played.structures[termios.TIOCGICOUNT] = struct.pack("@11i", 1, 2, 3, 4, 500, 600, 7, 8, 9, 10, 11)

    assert read_counters(0) == UartCounters(framing=7, parity=9, overrun=8 + 11, breaks=10)


def test_a_pty_counts_nothing(tty: int) -> None:
    assert read_counters(tty) is None
