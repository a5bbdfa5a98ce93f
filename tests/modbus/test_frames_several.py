"""Frames of bits and of writes of several: functions 1, 2, 15 and 16, as pymodbus's own server understands them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.bit_message import ReadCoilsResponse, ReadDiscreteInputsResponse
from pymodbus.pdu.register_message import WriteMultipleRegistersResponse

from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.request import ReadRegisters, Request, WriteRegister

RTU, ASCII = Codec(Framing.RTU), Codec(Framing.ASCII)
SERVER = DecodePDU(is_server=True)
CODECS = pytest.mark.parametrize("codec", [RTU, ASCII], ids=["rtu", "ascii"])


@pytest.mark.parametrize(
    ("request_", "frame"),
    [
        (ReadRegisters(17, 0x0013, 37, 1), "11 01 00 13 00 25 0E 84"),  # Modbus over Serial Line, section 6.1's example
        (ReadRegisters(17, 0x00C4, 22, 2), "11 02 00 C4 00 16 BA A9"),
        (WriteRegister(17, 0x0001, 0x000A, 16), "11 10 00 01 00 01 02 00 0A 35 76"),
    ],
)
@CODECS
def test_pymodbus_understands_every_request_as_it_was_meant(request_: Request, frame: str, codec: Codec) -> None:
    encoded = codec.encode(request_)
    if codec is RTU:
        assert encoded[:-2] == bytes.fromhex(frame)[:-2]
    body = codec.unwrap(encoded)
    assert body is not None
    pdu = SERVER.decode(body[1:])
    assert pdu is not None
    assert (pdu.function_code, pdu.address) == (request_.function, request_.address)
    if isinstance(request_, ReadRegisters):
        assert pdu.count == request_.count
    else:
        assert pdu.registers == [request_.value]


@CODECS
@given(function=st.sampled_from([1, 2]), bits=st.lists(st.booleans(), min_size=1, max_size=80))
def test_bits_come_as_pymodbus_sends_them(codec: Codec, function: int, bits: list[bool]) -> None:
    kind = ReadCoilsResponse if function == 1 else ReadDiscreteInputsResponse
    body = bytes((3, function)) + kind(bits=list(bits)).encode()
    request = ReadRegisters(3, 0, len(bits), function)
    frame = codec.wrap(body)
    shape, _ = codec.shapes(request)
    assert frame.startswith(shape.head)
    assert len(frame) == shape.size == codec.answer_size(request)
    assert list(codec.decode(body))[: len(bits)] == [int(bit) for bit in bits]
    assert len(codec.decode(body)) == 8 * request.data_bytes


@CODECS
@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        (WriteRegister(3, 0x1000, 7, 16), WriteMultipleRegistersResponse(address=0x1000, count=1)),
    ],
)
def test_a_write_of_several_is_confirmed_by_place_and_count(
    codec: Codec, request_: Request, answer: WriteMultipleRegistersResponse
) -> None:
    body = bytes((3, answer.function_code)) + answer.encode()
    shape, refused = codec.shapes(request_)
    assert codec.wrap(body).startswith(shape.head)
    assert len(codec.wrap(body)) == shape.size
    assert refused.size == codec.size(3)
    assert codec.decode(body) == ()
    assert codec.decode(bytes((3, answer.function_code | 0x80, 1))) == (1,)


@pytest.mark.parametrize(
    "frame", [RTU.encode(WriteRegister(3, 5, 7, 16)), RTU.wrap(bytes.fromhex("03 0F 00 05 00 14 03 FF FF 0F"))]
)
def test_a_long_request_is_found_among_noise_and_so_is_what_follows_it(frame: bytes) -> None:
    answer = RTU.encode(ReadRegisters(9, 1, 2))
    found = [(begin, end) for begin, end, _ in RTU.frames(b"\xff\x42" + frame + answer, 1, 5)]
    assert found == [(2, 2 + len(frame)), (2 + len(frame), 2 + len(frame) + len(answer))]
