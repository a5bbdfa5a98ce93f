"""What others say on the line: right frames that are no answer to a request of ours. Pure.

Only reads are looked for, of the slaves that are polled: requests of another master (slave id, function 03 or 04, two
words), answers (a byte count that is even) and exceptions. Whatever else is on the line is passed over.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from lfs10d.modbus.frames import (
    EXCEPTION_FLAG,
    READ_COUNT_MAX,
    READ_HOLDING_REGISTERS,
    READ_INPUT_REGISTERS,
    Codec,
    Framing,
    ReadRegisters,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

KEPT = 600
"""Characters kept of a frame whose end has not come: more than the longest has (513, ASCII)."""
PAUSE = 0.1
"""Seconds of silence after which what was begun is no frame any more."""
_READS = frozenset({READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS})
_REQUEST_BODY = 6
_LEAST_BODY = 3
_NO_SLAVE = 0


@dataclass(frozen=True, slots=True)
class Overheard:
    """A right frame to or from `slave`, whole at `at` (s): another master's `request`, or an answer (None)."""

    slave: int
    at: float
    body: bytes
    request: ReadRegisters | None = None


class Overhearing:
    """Collects what is heard; `codecs` are those of the slaves that are polled, by slave id."""

    def __init__(self) -> None:
        self.codecs: Mapping[int, Codec] = {}
        self._stream = b""
        self._last = float("-inf")

    def hear(self, pieces: Iterable[tuple[bytes, float]]) -> Iterator[Overheard]:
        """Take what was read, in order, each piece with its time; yield the frames that are whole by it."""
        for data, at in pieces:
            if at > self._last + PAUSE:
                self._stream = b""
            self._last = at
            self._stream += data
            for codec in dict.fromkeys(self.codecs.values()):
                yield from self._found(codec, at)
            self._stream = self._stream[-KEPT:]

    def _found(self, codec: Codec, at: float) -> Iterator[Overheard]:
        over = 0
        if codec.framing is Framing.RTU and not self._worth_it():
            return
        for begin, end, body in codec.frames(codec.fold(self._stream), _NO_SLAVE, 0):
            if begin < over or self.codecs.get(body[0]) != codec:
                continue
            frame = _overheard(body, at)
            if frame is not None:
                over = end
                yield frame
        self._stream = self._stream[over:]

    def _worth_it(self) -> bool:
        """Whether any place in the stream begins as a frame of a slave that is polled does."""
        stream = self._stream
        return any(
            stream[n + 1] & ~EXCEPTION_FLAG in _READS and stream[n] in self.codecs for n in range(len(stream) - 1)
        )


def _overheard(body: bytes, at: float) -> Overheard | None:
    """Return what a right frame is; None for what no read needs."""
    slave, function, size = body[0], body[1], len(body)
    if function & ~EXCEPTION_FLAG not in _READS or size < _LEAST_BODY:
        return None
    if function & EXCEPTION_FLAG:
        return Overheard(slave, at, body) if size == _LEAST_BODY else None
    if size == _REQUEST_BODY:
        address, count = int.from_bytes(body[2:4], "big"), int.from_bytes(body[4:6], "big")
        if not 1 <= count <= READ_COUNT_MAX or address + count > 1 << 16:
            return None
        return Overheard(slave, at, body, ReadRegisters(slave, address, count, function))
    right = body[2] == size - _LEAST_BODY and not body[2] % 2
    return Overheard(slave, at, body) if right else None
