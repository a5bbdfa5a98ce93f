"""The master's end of the bench's paced line."""

from __future__ import annotations

import os
import select
import termios
import time
import tty
from typing import Self

from bench.line import PacedLine
from tests.support.plain_wire import crc16

BAUDRATE = 1200
CHARACTER = 10 / BAUDRATE


T35 = 3.5 * CHARACTER


PATIENCE = 10.0
WIND = bytes((3, 0, 1, 0, 2))
"""Read registers 0x0001 and 0x0002: the wind speed."""
ID = bytes((3, 0, 5, 0, 1))
"""Read register 0x0005: the slave id."""


def request(slave: int, pdu: bytes = WIND) -> bytes:
    """Return a whole request."""
    head = bytes((slave,)) + pdu
    return head + crc16(head)


class Terminal:
    """A hand on the other end of the line."""

    def __init__(self, line: PacedLine, speed: int = termios.B1200) -> None:
        self.fd = os.open(line.port, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.fd)
        settings = termios.tcgetattr(self.fd)
        settings[4] = settings[5] = speed
        termios.tcsetattr(self.fd, termios.TCSANOW, settings)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self.fd)

    def send(self, frame: bytes) -> None:
        """Put bytes on the line now."""
        os.write(self.fd, frame)

    def hear(self, count: int) -> list[bytes]:
        """Wait for so many bytes; return the pieces in which they came."""
        pieces: list[bytes] = []
        while sum(map(len, pieces)) < count:
            ready, _, _ = select.select([self.fd], [], [], PATIENCE)
            assert ready, f"heard only {b''.join(pieces).hex(' ')}"
            pieces.append(os.read(self.fd, 256))
        return pieces

    def ask(self, frame: bytes, count: int = 9) -> bytes:
        """Send after due silence, and hear the answer."""
        self.rest()
        self.send(frame)
        return b"".join(self.hear(count))

    @staticmethod
    def rest() -> None:
        """Let the line be silent for more than t3.5 after what was heard last."""
        time.sleep(2 * T35)
