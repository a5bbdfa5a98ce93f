"""Requests and answers to bytes and back: every frame of the source documents, and what we rely on in pymodbus."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import pymodbus
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerAscii, FramerRTU
from pymodbus.pdu import DecodePDU, ExceptionResponse

from lfs10d.modbus.description import describe
from lfs10d.modbus.frames import Checksum, Codec, Framing
from lfs10d.modbus.request import ReadRegisters, Request, WriteRegister

RTU = Codec(Framing.RTU)
SUM = Codec(Framing.RTU, Checksum.SUM)
ASCII = Codec(Framing.ASCII)
CODECS = st.sampled_from([RTU, SUM, ASCII])
READS = st.integers(1, 125).flatmap(
    lambda count: st.builds(
        ReadRegisters, st.integers(1, 255), st.integers(0, 0x10000 - count), st.just(count), st.sampled_from([3, 4])
    )
)
WRITES = st.builds(WriteRegister, st.integers(0, 255), st.integers(0, 0xFFFF), st.integers(0, 0xFFFF))
WIND = ReadRegisters(1, 0x0001, 2)


@dataclass(frozen=True)
class Vector:
    """One frame of the source documents, printed or computed, in both framings."""

    name: str
    body: bytes
    rtu: bytes
    ascii: bytes


def vectors() -> list[Vector]:
    entries = json.loads(Path(__file__).with_name("vectors.json").read_text())
    return [
        Vector(each["name"], bytes.fromhex(each["body"]), bytes.fromhex(each["rtu"]), each["ascii"].encode())
        for each in entries
    ]


def request_of(body: bytes) -> Request | None:
    """Return the request that a body of six bytes is; None if it can only be an answer."""
    if len(body) != 6:
        return None
    first, second = int.from_bytes(body[2:4], "big"), int.from_bytes(body[4:6], "big")
    return WriteRegister(body[0], first, second) if body[1] == 6 else ReadRegisters(body[0], first, second)


EVERY_VECTOR = pytest.mark.parametrize("vector", vectors(), ids=lambda vector: str(vector.name))
REQUESTS = pytest.mark.parametrize(
    "vector", [vector for vector in vectors() if request_of(vector.body)], ids=lambda vector: str(vector.name)
)


@EVERY_VECTOR
def test_every_frame_of_the_documents_is_made_and_taken_apart(vector: Vector) -> None:
    assert RTU.wrap(vector.body) == vector.rtu
    assert ASCII.wrap(vector.body) == vector.ascii
    assert RTU.unwrap(vector.rtu) == vector.body
    assert ASCII.unwrap(vector.ascii) == vector.body
    assert RTU.size(len(vector.body)) == len(vector.rtu)
    assert ASCII.size(len(vector.body)) == len(vector.ascii)


@REQUESTS
def test_every_request_of_the_documents_is_asked_by_its_frame(vector: Vector) -> None:
    request = request_of(vector.body)
    assert request is not None
    assert RTU.encode(request) == vector.rtu
    assert ASCII.encode(request) == vector.ascii


@EVERY_VECTOR
def test_every_frame_of_the_documents_has_words(vector: Vector) -> None:
    assert describe(vector.rtu, RTU) == describe(vector.ascii, ASCII)
    assert f"slave {vector.body[0]}" in describe(vector.rtu, RTU)


@pytest.mark.parametrize(("body", "check"), [("010620000001", "0028"), ("010800010BB8", "00CD")])
def test_the_sum_is_of_all_bytes_high_byte_first(body: str, check: str) -> None:
    """EH600 inverter, parameter FC.01."""
    assert SUM.wrap(bytes.fromhex(body)) == bytes.fromhex(body + check)


@pytest.mark.parametrize(
    ("codec", "request_", "size"),
    [
        (RTU, WIND, 9),
        (RTU, ReadRegisters(1, 0x0005, 1), 7),
        (RTU, ReadRegisters(255, 0, 125), 255),
        (RTU, WriteRegister(1, 5, 2), 8),
        (SUM, WIND, 9),
        (ASCII, WIND, 19),
        (ASCII, ReadRegisters(255, 0, 125), 511),
        (ASCII, WriteRegister(1, 5, 2), 17),
    ],
)
def test_the_answers_size_is_known_beforehand(codec: Codec, request_: Request, size: int) -> None:
    assert codec.answer_size(request_) == size


def test_the_shapes_tell_slave_function_and_count_or_the_whole_write() -> None:
    normal, exception = RTU.shapes(WIND)
    assert (normal.head, normal.size, normal.sign) == (b"\x01\x03\x04", 9, 2)
    assert (exception.head, exception.size, exception.sign) == (b"\x01\x83", 5, 2)
    assert RTU.shapes(WriteRegister(1, 5, 2))[0].head == bytes.fromhex("010600050002")
    assert ASCII.shapes(WIND)[0].head == b":010304"
    assert ASCII.shapes(WIND)[1].sign == 5
    assert RTU.forms(WIND) == (RTU.encode(WIND), (normal, exception))


@given(CODECS, st.one_of(READS, WRITES))
def test_a_request_survives_the_wire(codec: Codec, request_: Request) -> None:
    body = codec.unwrap(codec.encode(request_))
    assert body is not None
    assert body[:2] == bytes((request_.slave, request_.function))
    if request_.function != 4:
        assert request_of(body) == request_


@given(CODECS, READS, st.data())
def test_registers_survive_the_wire(codec: Codec, request_: ReadRegisters, data: st.DataObject) -> None:
    count = request_.count
    registers = tuple(data.draw(st.lists(st.integers(0, 0xFFFF), min_size=count, max_size=count)))
    content = b"".join(register.to_bytes(2, "big") for register in registers)
    frame = codec.wrap(bytes((request_.slave, request_.function, 2 * count)) + content)
    shape = codec.shapes(request_)[0]
    assert frame.startswith(shape.head)
    assert len(frame) == shape.size
    body = codec.unwrap(frame)
    assert body is not None
    assert codec.decode(body) == registers


def test_a_confirmed_write_gives_its_value_and_an_exception_its_code() -> None:
    assert RTU.decode(bytes.fromhex("010600050002")) == (2,)
    assert RTU.decode(bytes.fromhex("018302")) == (2,)


def test_what_pymodbus_cannot_decode_gives_nothing() -> None:
    assert RTU.decode(bytes.fromhex("0163")) == ()


@given(CODECS, st.one_of(READS, WRITES), st.data())
def test_one_flipped_bit_is_noticed(codec: Codec, request_: Request, data: st.DataObject) -> None:
    frame = bytearray(codec.encode(request_))
    place = data.draw(st.integers(0, len(frame) - 1))
    frame[place] ^= 1 << data.draw(st.integers(0, 7))
    unwrapped = codec.unwrap(bytes(frame))
    # In ASCII a flipped bit may turn A into a: the same digit.
    assert unwrapped is None or unwrapped == codec.unwrap(codec.encode(request_))


@pytest.mark.parametrize(
    "frame",
    [
        b"",
        b":",
        b":\r\n",
        b"010304\r\n",
        b":0103F\r\n",
        b":01 03 04F8\r\n",
        b":01FF\r\n",
        b":0103FC\n\r",
        b":G103FC\r\n",
    ],
)
def test_broken_ascii_is_no_frame(frame: bytes) -> None:
    assert ASCII.unwrap(frame) is None


def test_lower_case_digits_are_understood() -> None:
    assert ASCII.unwrap(b":010304d0f5000033\r\n") == bytes.fromhex("010304D0F50000")
    assert ASCII.fold(b":010304d0f5") == b":010304D0F5"
    assert RTU.fold(b"abc") == b"abc"


def test_right_frames_are_found_at_any_offset() -> None:
    wind, refused = bytes.fromhex("010304414FD70A002F"), bytes.fromhex("018302C0F1")
    stream = b"\xff\x03" + wind + b"\x00" + refused + bytes.fromhex("010600030001B80A")
    found = [(begin, body[:2]) for begin, _, body in RTU.frames(stream, 1, 9)]
    assert found == [(2, b"\x01\x03"), (12, b"\x01\x83"), (17, b"\x01\x06")]


def test_a_frame_of_unknown_length_is_found_where_the_slave_begins_or_as_the_whole() -> None:
    strange = RTU.wrap(bytes.fromhex("0141AABBCCDDEE"))
    assert [begin for begin, _, _ in RTU.frames(b"\x00" + strange, 1, len(strange))] == [1]
    assert list(RTU.frames(b"\x00" + strange, 2, len(strange))) == []
    assert [begin for begin, _, _ in RTU.frames(strange, 2, 9)] == [0]


def test_ascii_frames_are_found_from_colon_to_line_feed() -> None:
    stream = b"xx:0103" + b":0183027A\r\n" + b":0183027B\r\n" + b":010310040002E6\r\n"
    assert [body.hex() for _, _, body in ASCII.frames(stream, 1, 19)] == ["018302", "010310040002"]


class TestWhatWeRelyOnInPymodbus:
    """A new release of pymodbus must keep all of this."""

    def test_release(self) -> None:
        assert pymodbus.__version__.startswith("3.16.")

    def test_the_crc_is_the_specifications_low_byte_first(self) -> None:
        assert FramerRTU.compute_CRC(bytes.fromhex("010300010002")) == 0x95CB

    def test_ascii_is_upper_case_from_colon_to_line_feed(self) -> None:
        frame = FramerAscii(DecodePDU(is_server=False)).encode(b"\x83\x02", 0xFF, 0)
        assert frame == b":FF83027C\r\n"
        assert FramerAscii.compute_LRC(b"\xff\x83\x02") == 0x7C

    def test_an_answer_is_decoded_to_registers_and_an_exception_to_its_code(self) -> None:
        decoder = DecodePDU(is_server=False)
        answer = decoder.decode(bytes.fromhex("0304414FD70A"))
        assert answer is not None
        assert list(answer.registers) == [0x414F, 0xD70A]
        refused = decoder.decode(b"\x86\x03")
        assert isinstance(refused, ExceptionResponse)
        assert refused.exception_code == 3
