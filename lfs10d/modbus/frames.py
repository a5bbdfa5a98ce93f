"""Requests and answers to bytes and back, RTU and ASCII. The only importer of pymodbus.

::

    RTU     [ slave ][ function ][ data ... ][ check, 2 bytes ]           CRC low byte first, SUM high byte first
    ASCII   ":" [ the same bytes and the LRC as two hex digits each ] CR LF

Whether a frame's check is right, and whether it answers a request, is decided here and in `search`, before
pymodbus sees it: its own framers lose a good frame behind one byte of noise and accept a wrong function.
"""

from __future__ import annotations

import re
from binascii import Error as NotHexError
from binascii import a2b_hex, b2a_hex
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from struct import unpack

from pymodbus.framer import FramerAscii, FramerRTU
from pymodbus.pdu import DecodePDU, ExceptionResponse, ModbusPDU
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    WriteSingleRegisterRequest,
)

from lfs10d.modbus.request import (
    READ_HOLDING_REGISTERS,
    READ_INPUT_REGISTERS,
    WRITE_SINGLE_REGISTER,
    Request,
    WriteRegister,
)

EXCEPTION_FLAG = 0x80
"""Added to the function code of a refused request (Modbus Application Protocol V1.1b3, section 7)."""

EXCEPTION_NAMES = {
    1: "illegal function",
    2: "illegal register address",
    3: "illegal data",
    4: "device failure",
    5: "acknowledged, still working",
    6: "busy",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "device behind the gateway silent",
}
"""What exception codes say (Modbus Application Protocol V1.1b3, section 7; LFS10-RS485 Protocol for 2 and 3)."""

_ASCII_OVERHEAD = 3
"""Colon, carriage return, line feed."""

_ASCII_FRAME = re.compile(rb":([0-9A-Fa-f]{6,510})\r\n")
_COUNTED = frozenset({1, 2, 3, 4})
"""Functions whose answer says its own length in its third byte."""
_ECHOING = frozenset({5, 6, 8, 15, 16})
"""Functions whose answer has the shape of a single write: eight bytes in RTU."""
_FIXED_SIZE = 8
_EXCEPTION_SIZE = 5
_RTU_MIN = 4
"""Slave, function and check: nothing shorter can be a frame."""


class Framing(StrEnum):
    """How bytes become frames on a line."""

    RTU = "rtu"
    ASCII = "ascii"


class Checksum(StrEnum):
    """The check field of RTU frames; ASCII always has its LRC.

    `SUM` is the 16-bit sum of the bytes before it, high byte first (EH600 manual, parameter FC.01).
    """

    CRC = "crc"
    SUM = "sum"


@dataclass(frozen=True, slots=True)
class Shape:
    """How one right answer looks on the wire: its first characters, and how many it has.

    `sign` is how many characters of `head` must have come before bytes count as the beginning of this answer:
    slave id and function.
    """

    head: bytes
    size: int
    sign: int


@dataclass(frozen=True, slots=True)
class Codec:
    """The frames of one slave. Sizes and offsets count characters on the wire."""

    framing: Framing
    checksum: Checksum = Checksum.CRC

    def encode(self, request: Request) -> bytes:
        """Return the request as it goes over the wire."""
        return _encoded(self, request)

    def size(self, body: int) -> int:
        """Return the characters of a frame whose slave id, function and data are `body` bytes."""
        return body + 2 if self.framing is Framing.RTU else 2 * (body + 1) + _ASCII_OVERHEAD

    def answer_size(self, request: Request) -> int:
        """Return the characters of the normal answer: RTU 5 + 2 per register read, 8 for a write."""
        return self.shapes(request)[0].size

    def shapes(self, request: Request) -> tuple[Shape, Shape]:
        """Return how the normal answer and the exception answer look."""
        return _shapes(self, request)

    def fold(self, data: bytes) -> bytes:
        """Return what was heard in the one form that `shapes` knows: hex digits of ASCII in upper case.

        The specification sends upper case only; the LRC guards the content whichever is heard.
        """
        return data if self.framing is Framing.RTU else data.upper()

    def unwrap(self, frame: bytes) -> bytes | None:
        """Return slave id, function and data of a whole frame, or None where its check is wrong."""
        if self.framing is Framing.RTU:
            body = frame[:-2]
            return body if len(frame) >= _RTU_MIN and frame[-2:] == self._check(body) else None
        if frame[:1] != FramerAscii.START or frame[-2:] != FramerAscii.END:
            return None
        try:
            content = a2b_hex(frame[1:-2])
        except NotHexError:
            return None
        body = content[:-1]
        right = len(content) >= _RTU_MIN - 1 and content[-1] == FramerAscii.compute_LRC(body)
        return body if right else None

    def wrap(self, body: bytes) -> bytes:
        """Return the frame of slave id, function and data."""
        if self.framing is Framing.RTU:
            return body + self._check(body)
        return FramerAscii(_ANSWERS).encode(body[1:], body[0], 0)

    def decode(self, body: bytes) -> tuple[int, ...]:
        """Return the registers of a normal answer, or the code of an exception answer as the only item.

        `body` must be of a frame that was found right and of a shape of `shapes`.
        """
        if body[1] in (READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS):
            # What pymodbus says, at a tenth of its price: it is asked at every poll.
            return unpack(f">{body[2] // 2}H", body[3:])
        answer = _ANSWERS.decode(body[1:])
        if isinstance(answer, ExceptionResponse):
            return (answer.exception_code,)
        return () if answer is None else tuple(answer.registers)

    def frames(self, stream: bytes, slave: int, size: int) -> Iterator[tuple[int, int, bytes]]:
        """Yield (begin, end, body) of every frame with a right check, whoever sent it, at any offset.

        Frames whose function does not tell their length are tried at `size` characters where they begin with
        `slave`, and as the whole stream.
        """
        if self.framing is Framing.ASCII:
            for match in _ASCII_FRAME.finditer(stream):
                if (body := self.unwrap(match[0])) is not None:
                    yield match.start(), match.end(), body
            return
        for begin in range(len(stream) - _RTU_MIN + 1):
            sizes = _rtu_sizes(stream, begin)
            if stream[begin] == slave:
                sizes.add(size)
            if begin == 0:
                sizes.add(len(stream))
            for end in sorted(begin + known for known in sizes):
                if end <= len(stream) and (body := self.unwrap(stream[begin:end])) is not None:
                    yield begin, end, body

    def _check(self, body: bytes) -> bytes:
        if self.checksum is Checksum.SUM:
            return (sum(body) & 0xFFFF).to_bytes(2, "big")
        return FramerRTU.compute_CRC(body).to_bytes(2, "big")


_ANSWERS = DecodePDU(is_server=False)


@lru_cache(maxsize=1024)
def _encoded(codec: Codec, request: Request) -> bytes:
    pdu: ModbusPDU
    if isinstance(request, WriteRegister):
        pdu = WriteSingleRegisterRequest(address=request.address, registers=[request.value])
    elif request.function == READ_INPUT_REGISTERS:
        pdu = ReadInputRegistersRequest(address=request.address, count=request.count)
    else:
        pdu = ReadHoldingRegistersRequest(address=request.address, count=request.count)
    return codec.wrap(bytes((request.slave, pdu.function_code)) + pdu.encode())


@lru_cache(maxsize=1024)
def _shapes(codec: Codec, request: Request) -> tuple[Shape, Shape]:
    address = bytes((request.slave, request.function))
    refused = bytes((request.slave, request.function | EXCEPTION_FLAG))
    if isinstance(request, WriteRegister):
        head = address + request.address.to_bytes(2, "big") + request.value.to_bytes(2, "big")
        body = len(head)
    else:
        head = address + bytes((2 * request.count,))
        body = len(head) + 2 * request.count
    return _shape(codec, head, body), _shape(codec, refused, len(refused) + 1)


def _shape(codec: Codec, head: bytes, body: int) -> Shape:
    if codec.framing is Framing.RTU:
        return Shape(head, codec.size(body), sign=2)
    return Shape(FramerAscii.START + b2a_hex(head).upper(), codec.size(body), sign=5)


def _rtu_sizes(stream: bytes, begin: int) -> set[int]:
    """Return the lengths that a frame of the function at `begin` can have, as an answer or as a request."""
    function = stream[begin + 1]
    if function & EXCEPTION_FLAG:
        return {_EXCEPTION_SIZE}
    if function in _COUNTED:
        return {_EXCEPTION_SIZE + stream[begin + 2], _FIXED_SIZE}
    return {_FIXED_SIZE} if function in _ECHOING else set()


_DESCRIBED = 16
"""So many frames of one piece are put into words."""


def describe(frame: bytes, codec: Codec) -> str:
    """Return what was sent or heard in words, for traces and logs; our own words and hex digits only.

    `frame` may hold several frames and noise.
    """
    stream = codec.fold(frame)
    parts: list[str] = []
    at = 0
    for begin, end, body in codec.frames(stream, stream[0] if stream else 0, len(stream)):
        if begin < at or len(parts) >= _DESCRIBED:
            continue
        parts += _noise(begin - at)
        parts.append(_in_words(body))
        at = end
    return "; ".join(parts + _noise(len(stream) - at)) or "nothing"


def _noise(count: int) -> list[str]:
    return [f"{count} byte{'s' * (count > 1)} of no frame"] if count else []


def _in_words(body: bytes) -> str:
    slave, function, data = body[0], body[1], body[2:]
    whose = f"slave {slave}" if slave else "every slave"
    if function & EXCEPTION_FLAG and len(data) == 1:
        name = EXCEPTION_NAMES.get(data[0], "of the device's own")
        return f"{whose} refuses function {function - EXCEPTION_FLAG:02X}: exception {data[0]:02X} {name}"
    if len(data) == _REQUEST_DATA:
        first, second = int.from_bytes(data[:2], "big"), int.from_bytes(data[2:], "big")
        if function in (READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS):
            return f"read {second} register{'s' * (second != 1)} at 0x{first:04X} of {whose}"
        if function == WRITE_SINGLE_REGISTER:
            return f"write 0x{second:04X} to 0x{first:04X} of {whose}"
    if function in (READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS) and data and data[0] == len(data) - 1:
        return f"{whose} answers {data[1:].hex(' ', 2).upper()}"
    return f"function {function:02X} of {whose}: {data.hex(' ').upper()}"


_REQUEST_DATA = 4
"""Address and count, or address and value."""
