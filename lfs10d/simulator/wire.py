"""Frames and times as the simulator itself computes them: a second opinion on the master's own.

Nothing here comes from `lfs10d.modbus`: whoever judges must not share the mistakes of the judged.
Times are integer nanoseconds; a frame's *body* is slave id, function and data, without its check.
"""

from __future__ import annotations

from binascii import unhexlify
from dataclasses import field
from typing import Final, Literal, TypeAlias

from lfs10d.system.dataclass import dataclass

Framing: TypeAlias = Literal["rtu", "ascii"]
Check: TypeAlias = Literal["crc", "sum"]
Parity: TypeAlias = Literal["none", "even", "odd"]

SECOND: Final = 1_000_000_000
"""Nanoseconds in a second."""

FIXED_TIMES_ABOVE: Final = 19_200
"""Above this rate the two times are fixed (Modbus over Serial Line V1.02, section 2.5.1.1)."""

FIXED_T15: Final = 750_000
"""t1.5 above 19200 baud, in ns (Modbus over Serial Line V1.02, section 2.5.1.1)."""

FIXED_T35: Final = 1_750_000
"""t3.5 above 19200 baud, in ns (Modbus over Serial Line V1.02, section 2.5.1.1)."""

CRC_POLYNOMIAL: Final = 0xA001
"""CRC-16/MODBUS, reflected (Modbus over Serial Line V1.02, section 6.2.2)."""

SHORTEST_BODY: Final = 2
"""Slave id and function."""

LONGEST_FRAME: Final = 256
"""Bytes of the longest RTU frame (Modbus over Serial Line V1.02, section 2.5.1)."""


def nanoseconds(seconds: float) -> int:
    """Return the nearest whole number of nanoseconds."""
    return round(seconds * SECOND)


@dataclass(frozen=True, slots=True)
class Format:
    """Rate and shape of the characters a station sends and understands; its times in ns."""

    baudrate: int = 9600
    databits: int = 8
    parity: Parity = "none"
    stopbits: int = 1
    bits: int = field(init=False, repr=False, compare=False)
    character: int = field(init=False, repr=False, compare=False)
    t15: int = field(init=False, repr=False, compare=False)
    t35: int = field(init=False, repr=False, compare=False)
    offsets: tuple[int, ...] = field(init=False, repr=False, compare=False)
    """When the n-th character of an unbroken run ends, counted from the run's first bit."""

    def __post_init__(self) -> None:
        bits = 1 + self.databits + (self.parity != "none") + self.stopbits
        slow = self.baudrate <= FIXED_TIMES_ABOVE
        computed = {
            "bits": bits,
            "character": bits * SECOND // self.baudrate,
            "t15": 3 * bits * SECOND // (2 * self.baudrate) if slow else FIXED_T15,
            "t35": 7 * bits * SECOND // (2 * self.baudrate) if slow else FIXED_T35,
            "offsets": tuple((n + 1) * bits * SECOND // self.baudrate for n in range(LONGEST_FRAME)),
        }
        for name, value in computed.items():
            object.__setattr__(self, name, value)

    def span(self, characters: int) -> int:
        """Return how long that many characters take without a pause."""
        return characters * self.bits * SECOND // self.baudrate

    def ends(self, start: int, characters: int, pause: int = 0) -> list[int]:
        """Return when each character ends, the first beginning at `start`, with a pause between any two."""
        if pause == 0 and characters <= LONGEST_FRAME:
            return [start + offset for offset in self.offsets[:characters]]
        return [start + self.span(n + 1) + n * pause for n in range(characters)]


def _crc_of_byte(value: int) -> int:
    for _ in range(8):
        value = value >> 1 ^ CRC_POLYNOMIAL if value & 1 else value >> 1
    return value


_CRC_TABLE: Final = tuple(_crc_of_byte(value) for value in range(256))


def crc(data: bytes) -> bytes:
    """Return the CRC as it goes over the line, low byte first."""
    register = 0xFFFF
    for byte in data:
        register = register >> 8 ^ _CRC_TABLE[(register ^ byte) & 0xFF]
    return register.to_bytes(2, "little")


def total(data: bytes) -> bytes:
    """Return the 16-bit sum of the bytes, high byte first (EH600, parameter FC.01)."""
    return (sum(data) & 0xFFFF).to_bytes(2, "big")


def lrc(data: bytes) -> int:
    """Return the two's complement of the byte sum (Modbus over Serial Line V1.02, section 6.2.1)."""
    return -sum(data) & 0xFF


def seal(body: bytes, framing: Framing = "rtu", check: Check = "crc") -> bytes:
    """Return the frame that carries this body."""
    if framing == "ascii":
        return b":" + (body + bytes((lrc(body),))).hex().upper().encode() + b"\r\n"
    return body + (crc(body) if check == "crc" else total(body))


def unseal(frame: bytes, framing: Framing = "rtu", check: Check = "crc") -> bytes | None:
    """Return the body of a frame, or None if it is none or its check is wrong.

    In ASCII what stands before the last colon is dropped: a colon begins a frame anew.
    """
    if framing == "rtu":
        body = frame[:-2]
        whole = len(body) >= SHORTEST_BODY and frame[-2:] == (crc(body) if check == "crc" else total(body))
        return body if whole else None
    _, colon, text = frame.rpartition(b":")
    if not colon or not text.endswith(b"\r\n"):
        return None
    try:
        data = unhexlify(text[:-2])
    except ValueError:
        return None
    return data[:-1] if len(data) > SHORTEST_BODY and lrc(data) == 0 else None


_AT_THE_WRONG_RATE: Final = bytes((0x00, 0x80, 0xE0, 0xF8, 0xFC, 0xFE)[value % 6] for value in range(256))


def misheard(data: bytes) -> bytes:
    """Return what a receiver at another rate makes of these bytes: broken ones that are never a frame.

    None of them is a function code, so no slave and no master can take them for anything.
    """
    return data.translate(_AT_THE_WRONG_RATE)
