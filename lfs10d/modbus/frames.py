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
from collections.abc import Iterator, Mapping
from enum import StrEnum
from functools import lru_cache
from struct import unpack
from typing import NamedTuple

from pymodbus.framer import FramerAscii, FramerRTU
from pymodbus.pdu import DecodePDU, ExceptionResponse, ModbusPDU
from pymodbus.pdu.bit_message import ReadCoilsRequest, ReadDiscreteInputsRequest
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)

from lfs10d.modbus.request import (
    BIT_READS,
    READ_COILS,
    READ_DISCRETE_INPUTS,
    READ_HOLDING_REGISTERS,
    READ_INPUT_REGISTERS,
    READS,
    WRITE_MULTIPLE_COILS,
    WRITE_MULTIPLE_REGISTERS,
    ReadRegisters,
    Request,
)
from lfs10d.system.dataclass import dataclass

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
_ECHOING = frozenset({5, 6, 8, 15, 16})
"""Functions whose answer has the shape of a single write: eight bytes in RTU."""
_SEVERAL = frozenset({WRITE_MULTIPLE_COILS, WRITE_MULTIPLE_REGISTERS})
"""Functions whose request says in its seventh byte how many bytes of data follow."""
_COUNT_OF_SEVERAL = 6
_SEVERAL_SIZE = 9
"""Characters of such a request in RTU without its data."""
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


class Forms(NamedTuple):
    """A request as it goes over the wire, and how its normal answer and its exception answer look."""

    frame: bytes
    answers: tuple[Shape, Shape]


@dataclass(frozen=True, slots=True)
class Codec:
    """The frames of one slave. Sizes and offsets count characters on the wire."""

    framing: Framing
    checksum: Checksum = Checksum.CRC

    def forms(self, request: Request) -> Forms:
        """Return the request as it goes over the wire, and how its answers look."""
        return _forms(self, request)

    def encode(self, request: Request) -> bytes:
        """Return the request as it goes over the wire."""
        return _forms(self, request).frame

    def size(self, body: int) -> int:
        """Return the characters of a frame whose slave id, function and data are `body` bytes."""
        return body + 2 if self.framing is Framing.RTU else 2 * (body + 1) + _ASCII_OVERHEAD

    def answer_size(self, request: Request) -> int:
        """Return the characters of the normal answer: RTU 5 + 2 per register (1 per 8 bits) read, 8 for a write."""
        return self.shapes(request)[0].size

    def shapes(self, request: Request) -> tuple[Shape, Shape]:
        """Return how the normal answer and the exception answer look."""
        return _forms(self, request).answers

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

        Of bits each is a 0 or a 1; those that fill up the last byte come too. A write of several (15, 16) is confirmed
        without its content. `body` must be of a frame that was found right and of a shape of `shapes`.
        """
        function = body[1]
        if function in (READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS):
            # What pymodbus says, at a tenth of its price: it is asked at every poll.
            return unpack(f">{body[2] // 2}H", body[3:])
        if function in BIT_READS:
            return tuple(byte >> n & 1 for byte in body[3:] for n in range(8))
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
def _forms(codec: Codec, request: Request) -> Forms:
    return Forms(_encoded(codec, request), _shapes(codec, request))


def _encoded(codec: Codec, request: Request) -> bytes:
    pdu: ModbusPDU
    if isinstance(request, ReadRegisters):
        pdu = _READ_PDUS[request.function](address=request.address, count=request.count)
    else:
        several = request.function == WRITE_MULTIPLE_REGISTERS
        kind = WriteMultipleRegistersRequest if several else WriteSingleRegisterRequest
        pdu = kind(address=request.address, registers=[request.value])
    return codec.wrap(bytes((request.slave, pdu.function_code)) + pdu.encode())


_READ_PDUS: Mapping[int, type[ModbusPDU]] = {
    READ_COILS: ReadCoilsRequest,
    READ_DISCRETE_INPUTS: ReadDiscreteInputsRequest,
    READ_HOLDING_REGISTERS: ReadHoldingRegistersRequest,
    READ_INPUT_REGISTERS: ReadInputRegistersRequest,
}


def _shapes(codec: Codec, request: Request) -> tuple[Shape, Shape]:
    address = bytes((request.slave, request.function))
    refused = bytes((request.slave, request.function | EXCEPTION_FLAG))
    if isinstance(request, ReadRegisters):
        head = address + bytes((request.data_bytes,))
        body = len(head) + request.data_bytes
    else:
        confirmed = 1 if request.function == WRITE_MULTIPLE_REGISTERS else request.value
        head = address + request.address.to_bytes(2, "big") + confirmed.to_bytes(2, "big")
        body = len(head)
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
    if function in READS:
        return {_EXCEPTION_SIZE + stream[begin + 2], _FIXED_SIZE}
    sizes = {_FIXED_SIZE} if function in _ECHOING else set()
    if function in _SEVERAL and begin + _COUNT_OF_SEVERAL < len(stream):
        sizes.add(_SEVERAL_SIZE + stream[begin + _COUNT_OF_SEVERAL])
    return sizes
