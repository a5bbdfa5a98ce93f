"""Frames in words."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus.description import describe
from lfs10d.modbus.frames import Checksum, Codec, Framing

RTU = Codec(Framing.RTU)
CODECS = st.sampled_from([RTU, Codec(Framing.RTU, Checksum.SUM), Codec(Framing.ASCII)])


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ("", "nothing"),
        ("01030001000295CB", "read 2 registers at 0x0001 of slave 1"),
        ("010304414FD70A002F", "slave 1 answers 414F D70A"),
        ("018302C0F1", "slave 1 refuses function 03: exception 02 illegal register address"),
        ("01060004000249CA", "write 0x0002 to 0x0004 of slave 1"),
        ("FF", "1 byte of no frame"),
        ("FF00018302C0F1", "2 bytes of no frame; slave 1 refuses function 03: exception 02 illegal register address"),
        ("01060004000249CAFF", "write 0x0002 to 0x0004 of slave 1; 1 byte of no frame"),
    ],
)
def test_frames_are_told_in_words(frame: str, words: str) -> None:
    assert describe(bytes.fromhex(frame), RTU) == words


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("000600040002", "write 0x0002 to 0x0004 of every slave"),
        ("010300010001", "read 1 register at 0x0001 of slave 1"),
        ("0183AA", "slave 1 refuses function 03: exception AA of the device's own"),
        ("018302FF", "function 83 of slave 1: 02 FF"),
        ("010800010BB8", "function 08 of slave 1: 00 01 0B B8"),
        ("0141AA", "function 41 of slave 1: AA"),
        ("010306AABB", "function 03 of slave 1: 06 AA BB"),
        ("0103", "function 03 of slave 1: "),
    ],
)
def test_strange_frames_are_told_too(body: str, words: str) -> None:
    assert describe(RTU.wrap(bytes.fromhex(body)), RTU) == words


@given(CODECS, st.binary(max_size=300))
def test_words_are_printable_whatever_was_heard(codec: Codec, frame: bytes) -> None:
    words = describe(frame, codec)
    assert words.isascii()
    assert words.isprintable()


def test_a_long_piece_is_told_briefly() -> None:
    assert len(describe(bytes.fromhex("018302C0F1") * 200, RTU)) < 1500


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("03 01 00 05 00 01", "read 1 bit at 0x0005 of slave 3"),
        ("03 02 00 05 00 09", "read 9 bits at 0x0005 of slave 3"),
        ("03 02 02 CD 01", "slave 3 answers CD 01"),
        ("03 10 10 00 00 01 02 00 07", "write 0007 from 0x1000 on of slave 3"),
        ("03 10 10 00 00 01", "slave 3 confirms 1 register written from 0x1000 on"),
        ("03 0F 00 02 00 09", "slave 3 confirms 9 bits written from 0x0002 on"),
        ("03 0F 00 02 00 09 02 FF 01", "write FF01 from 0x0002 on of slave 3"),
        ("03 90 01", "slave 3 refuses function 10: exception 01 illegal function"),
        ("03 10 10 00 00", "function 10 of slave 3: 10 00 00"),
        ("03 10 10 00 00 01 02 00", "function 10 of slave 3: 10 00 00 01 02 00"),
    ],
)
def test_frames_of_bits_and_of_several_have_words(body: str, words: str) -> None:
    assert describe(RTU.wrap(bytes.fromhex(body)), RTU) == words
