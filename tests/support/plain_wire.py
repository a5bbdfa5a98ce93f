"""The wire as plainly as can be: the check of RTU and the port of a master that polls sensor after sensor."""

from __future__ import annotations

import os
import termios
import time
import tty
from dataclasses import dataclass, field

ANSWER = 9
BITS_PER_CHARACTER = 10
FIXED_ABOVE = 19200
FIXED_T35 = 0.001750
"""Modbus over Serial Line V1.02, section 2.5.1.1."""


def crc16(frame: bytes) -> bytes:
    """Return the two bytes of CRC-16/MODBUS, low byte first."""
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return crc.to_bytes(2, "little")


@dataclass
class Wire:
    """The times of one rate, in seconds, and the port's descriptor."""

    fd: int
    character: float
    t35: float
    slaves: int
    quiet_since: float = 0.0
    polls: int = 0
    requests: list[bytes] = field(default_factory=list)

    @classmethod
    def open(cls, path: str, baudrate: int, slaves: int) -> Wire:
        """Open the port raw at the rate."""
        fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(fd)
        settings = termios.tcgetattr(fd)
        settings[4] = settings[5] = getattr(termios, f"B{baudrate}")
        termios.tcsetattr(fd, termios.TCSANOW, settings)
        character = BITS_PER_CHARACTER / baudrate
        wire = cls(fd, character, FIXED_T35 if baudrate > FIXED_ABOVE else 3.5 * character, slaves)
        wire.quiet_since = time.monotonic()
        heads = [bytes((slave, 3, 0, 1, 0, 2)) for slave in range(1, slaves + 1)]
        wire.requests = [head + crc16(head) for head in heads]
        return wire

    def send(self) -> float:
        """Send the next request; return when its last character leaves."""
        request = self.requests[self.polls % self.slaves]
        os.write(self.fd, request)
        self.polls += 1
        self.quiet_since = time.monotonic() + len(request) * self.character
        return self.quiet_since

    def read(self) -> bytes:
        """Read what is there."""
        try:
            data = os.read(self.fd, 256)
        except BlockingIOError:
            return b""
        self.quiet_since = time.monotonic()
        return data
