"""Finds the frames of others on the line: valid frames that are no answer to a request of ours. Pure.

Only reads are looked for, of the slaves that are polled: requests of another master (slave id, function 01 to 04, two
words), answers (a byte count, of registers an even one) and exceptions. Whatever else is on the line is passed over.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from lfs10d.modbus.frames import EXCEPTION_FLAG, Codec, Framing
from lfs10d.modbus.request import BIT_READS, READ_BITS_MAX, READ_COUNT_MAX, READS, ReadRegisters
from lfs10d.system.dataclass import dataclass

KEPT = 600
"""Characters kept of a frame whose end has not come: more than the longest has (513, ASCII)."""
PAUSE = 0.1
"""Seconds of silence after which what was begun is no frame any more."""
_REQUEST_BODY = 6
_LEAST_BODY = 3
_REQUEST = 8
_EXCEPTION = 5
"""Characters of a request and of an exception in RTU; an answer has so many more as its third byte says."""


@dataclass(frozen=True, slots=True)
class Overheard:
    """A right frame to or from `slave`, whole at `at` (s): another master's `request`, or an answer (None)."""

    slave: int
    at: float
    body: bytes
    request: ReadRegisters | None = None


class Overhearing:
    """Collects what is heard, of the slaves that are polled."""

    def __init__(self) -> None:
        self._codecs: Mapping[int, Codec] = {}
        self._heads = re.compile(rb"(?!)")
        self._ascii = False
        self._stream = b""
        self._last = float("-inf")

    def listen_to(self, codecs: Mapping[int, Codec]) -> None:
        """Look for frames of these slaves, by slave id; all have one framing."""
        self._codecs = codecs
        slaves = b"".join(re.escape(bytes((slave,))) for slave in codecs)
        self._heads = re.compile(rb"(?=[" + slaves + rb"][\x01-\x04\x81-\x84])" if slaves else rb"(?!)", re.DOTALL)
        self._ascii = any(codec.framing is Framing.ASCII for codec in codecs.values())

    def hear(self, pieces: Iterable[tuple[bytes, float]]) -> Iterator[Overheard]:
        """Take what was read, in order, each piece with its time; yield the frames that are whole by it."""
        for data, at in pieces:
            if at > self._last + PAUSE:
                self._stream = b""
            self._last = at
            self._stream = (self._stream + data)[-KEPT:]
            yield from self._in_ascii(at) if self._ascii else self._in_rtu(at)

    def _in_rtu(self, at: float) -> Iterator[Overheard]:
        stream, over, open_from = self._stream, 0, len(self._stream) - 1
        for match in self._heads.finditer(stream):
            begin = match.start()
            if begin < over:
                continue
            sizes, codec = _sizes(stream, begin), self._codecs[stream[begin]]
            for size in sizes:
                body = codec.unwrap(stream[begin : begin + size]) if begin + size <= len(stream) else None
                frame = None if body is None else _overheard(body, at)
                if frame is not None:
                    over = begin + size
                    yield frame
                    break
            else:
                if begin + max(sizes) > len(stream):
                    open_from = min(open_from, begin)
        self._stream = stream[max(over, open_from, 0) :]

    def _in_ascii(self, at: float) -> Iterator[Overheard]:
        *whole, self._stream = self._stream.split(b"\n")
        for line in whole:
            for slave, codec in self._codecs.items():
                frame = line[max(0, line.rfind(b":")) :] + b"\n"
                body = codec.unwrap(codec.fold(frame))
                found = None if body is None or body[0] != slave else _overheard(body, at)
                if found is not None:
                    yield found


def _sizes(stream: bytes, begin: int) -> tuple[int, ...]:
    """Return the lengths that a frame of the function at `begin` can have: a request's, and an answer's if known."""
    if stream[begin + 1] & EXCEPTION_FLAG:
        return (_EXCEPTION,)
    count = stream[begin + 2] if begin + 2 < len(stream) else 0
    return (_REQUEST, _EXCEPTION + count)


def _overheard(body: bytes, at: float) -> Overheard | None:
    """Return what a right frame is; None for what no read needs."""
    slave, function, size = body[0], body[1], len(body)
    if function & ~EXCEPTION_FLAG not in READS or size < _LEAST_BODY:
        return None
    if function & EXCEPTION_FLAG:
        return Overheard(slave, at, body) if size == _LEAST_BODY else None
    if size == _REQUEST_BODY:
        address, count = int.from_bytes(body[2:4], "big"), int.from_bytes(body[4:6], "big")
        if not 1 <= count <= (READ_BITS_MAX if function in BIT_READS else READ_COUNT_MAX) or address + count > 1 << 16:
            return None
        return Overheard(slave, at, body, ReadRegisters(slave, address, count, function))
    right = body[2] == size - _LEAST_BODY and (function in BIT_READS or not body[2] % 2)
    return Overheard(slave, at, body) if right else None
