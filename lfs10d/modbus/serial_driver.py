"""What a serial driver can do beyond termios: low latency, RS485 direction, error counters.

Every driver lacks some of it, so nothing here fails: what was refused is told in words. Numbers are those of
Linux's asm-generic/ioctls.h, structures those of include/uapi/linux/serial.h.
"""

from __future__ import annotations

import errno
import fcntl
import math
import os
import struct
import termios
from pathlib import Path

from lfs10d.modbus.port_settings import Rs485
from lfs10d.reading import UartCounters
from lfs10d.system.dataclass import dataclass

SYSFS = Path("/sys")

USB_LATENCY = 0.020
"""Longest pause an adapter may put into one answer, s: 16 ms of an FTDI's timer and a margin."""

LOW_LATENCY = 0.004
"""The same where the adapter is known to hand over at once, s."""

TIOCGRS485 = 0x542E
TIOCSRS485 = 0x542F

_SERIAL_STRUCT = 128
"""More than struct serial_struct has on any machine (72 bytes on 64 bits)."""
_SERIAL_FLAGS = struct.Struct("@i")
_SERIAL_FLAGS_AT = 16
ASYNC_LOW_LATENCY = 1 << 13

_RS485 = struct.Struct("@IIIIIIII")
"""struct serial_rs485: flags, delay_rts_before_send, delay_rts_after_send (ms), five reserved words."""
SER_RS485_ENABLED = 1 << 0
SER_RS485_RTS_ON_SEND = 1 << 1
SER_RS485_RTS_AFTER_SEND = 1 << 2

_COUNTERS = struct.Struct("@11i")
"""struct serial_icounter_struct: cts dsr rng dcd rx tx frame overrun parity brk buf_overrun, then 9 reserved."""
_COUNTERS_SIZE = 80

_ABSENT = frozenset({errno.ENOTTY, errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS})
"""A driver's ways of saying that it has no such thing."""

_KNOBS = (
    ("device/latency_timer", "latency_timer", "milliseconds (FTDI)"),
    ("rx_trig_bytes", "rx_trig_bytes", "bytes (16550 FIFO)"),
)
"""Files under /sys/dev/char/MAJOR:MINOR that hold bytes back; 1 is the least. Unit for people."""


@dataclass(frozen=True, slots=True)
class Latency:
    """The longest delay of the adapter in s, and a message about it."""

    adapter: float
    notice: str | None = None


def lower_latency(fd: int, *, wanted: bool, sysfs: Path = SYSFS) -> Latency:
    """Set the low-latency mode if wanted; return the latency, verified by reading back."""
    refused = _ask_low_latency(fd) if wanted else None
    device = os.fstat(fd).st_rdev
    folder = sysfs / "dev" / "char" / f"{os.major(device)}:{os.minor(device)}"
    notice = f"the driver refuses its low-latency mode ({refused})" if refused else None
    for file, name, unit in _KNOBS:
        knob = folder / file
        before = _read_number(knob)
        if before is None:
            continue
        trouble = _write_one(knob) if wanted and before > 1 else None
        now = _read_number(knob)
        if now is not None and now <= 1:
            return Latency(LOW_LATENCY)
        if wanted:
            why = f" ({trouble})" if trouble else ""
            notice = (
                f"the adapter holds bytes back, {name} is {now} {unit} and could not be set to 1{why}: "
                f"polls take longer; as root: echo 1 > {knob}, or a udev rule that does it"
            )
    return Latency(USB_LATENCY, notice)


def switch_rs485(fd: int, rs485: Rs485) -> str | None:
    """Let the driver switch the transceiver by RTS; return what it refused, in words, or None."""
    current = bytearray(_RS485.size)
    try:
        fcntl.ioctl(fd, TIOCGRS485, current)
        wanted = rs485_struct(rs485, bytes(current))
        got = bytearray(wanted)
        fcntl.ioctl(fd, TIOCSRS485, got)
    except OSError as error:
        reason = "has no RS485 mode" if error.errno in _ABSENT else f"refuses its RS485 mode ({error.strerror})"
        return f"the driver {reason}: the adapter must switch its direction by itself; remove line.rs485 if it does"
    return None if got[:12] == wanted[:12] else "the driver changed the RS485 settings asked for: " + _described(got)


def rs485_struct(rs485: Rs485, current: bytes) -> bytes:
    """Return struct serial_rs485 as wanted; flags that are not ours are kept as in `current`.

    The structure knows whole milliseconds: a part of one is rounded up, for too short a delay cuts characters.
    """
    flags, _, _, *rest = _RS485.unpack(current)
    flags &= ~(SER_RS485_RTS_ON_SEND | SER_RS485_RTS_AFTER_SEND)
    flags |= SER_RS485_ENABLED
    flags |= SER_RS485_RTS_ON_SEND * rs485.rts_on_send | SER_RS485_RTS_AFTER_SEND * rs485.rts_after_send
    return _RS485.pack(flags, _whole_ms(rs485.delay_before_send), _whole_ms(rs485.delay_after_send), *rest)


def read_counters(fd: int) -> UartCounters | None:
    """Return the driver's error counters since it was loaded; None where it has none or the port is gone.

    `overrun` counts bytes lost in the UART and in the kernel's buffer alike.
    """
    raw = bytearray(_COUNTERS_SIZE)
    try:
        fcntl.ioctl(fd, termios.TIOCGICOUNT, raw)
    except OSError:
        return None
    *_, framing, overrun, parity, breaks, buffer_overrun = _COUNTERS.unpack_from(raw)
    return UartCounters(framing=framing, parity=parity, overrun=overrun + buffer_overrun, breaks=breaks)


def _ask_low_latency(fd: int) -> str | None:
    """Set ASYNC_LOW_LATENCY; returns why it was refused, None if it was set or there is no such flag."""
    raw = bytearray(_SERIAL_STRUCT)
    try:
        fcntl.ioctl(fd, termios.TIOCGSERIAL, raw)
        (flags,) = _SERIAL_FLAGS.unpack_from(raw, _SERIAL_FLAGS_AT)
        if not flags & ASYNC_LOW_LATENCY:
            _SERIAL_FLAGS.pack_into(raw, _SERIAL_FLAGS_AT, flags | ASYNC_LOW_LATENCY)
            fcntl.ioctl(fd, termios.TIOCSSERIAL, raw)
    except OSError as error:
        return None if error.errno in _ABSENT else error.strerror
    return None


def _read_number(knob: Path) -> int | None:
    try:
        return int(knob.read_text("ascii"))
    except (OSError, ValueError):
        return None


def _write_one(knob: Path) -> str | None:
    try:
        knob.write_text("1", "ascii")
    except OSError as error:
        return error.strerror
    return None


def _whole_ms(seconds: float) -> int:
    # Rounded to nanoseconds first: 0.003 s must not become 4 ms because 0.003 * 1000 is a hair above 3.
    return math.ceil(round(seconds * 1000, 6))


def _described(raw: bytes | bytearray) -> str:
    flags, before, after, *_ = _RS485.unpack(raw)
    mode = "on" if flags & SER_RS485_ENABLED else "off"
    on_send = bool(flags & SER_RS485_RTS_ON_SEND)
    after_send = bool(flags & SER_RS485_RTS_AFTER_SEND)
    return (
        f"it is {mode}, rts_on_send {on_send}, rts_after_send {after_send}, "
        f"delay_before_send {before} ms, delay_after_send {after} ms"
    ).lower()
