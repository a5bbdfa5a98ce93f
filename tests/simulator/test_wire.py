"""Frames and times of the simulator against the vectors and the specification."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.simulator.wire import LONGEST_FRAME, SECOND, Check, Format, Framing, misheard, seal, unseal

VECTORS: list[dict[str, Any]] = json.loads((Path(__file__).parents[1] / "modbus" / "vectors.json").read_text("utf-8"))
FRAMINGS: tuple[tuple[Framing, Check], ...] = (("rtu", "crc"), ("rtu", "sum"), ("ascii", "crc"))


@pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: str(vector["name"]))
def test_every_vector_is_sealed_and_unsealed_as_in_the_documents(vector: dict[str, Any]) -> None:
    body = bytes.fromhex(vector["body"])
    forms: dict[str, bytes] = {}
    if "rtu" in vector:
        forms["rtu"] = bytes.fromhex(vector["rtu"])
    if "ascii" in vector:
        forms["ascii"] = vector["ascii"].encode()
    assert forms
    for framing in ("rtu", "ascii"):
        if framing in forms:
            assert seal(body, framing) == forms[framing]
            assert unseal(forms[framing], framing) == body


def test_the_sum_check_is_high_byte_first() -> None:
    body = bytes.fromhex("01080001 0BB8".replace(" ", ""))
    assert seal(body, "rtu", "sum")[-2:] == bytes.fromhex("00CD")


@given(body=st.binary(min_size=2, max_size=60), form=st.sampled_from(FRAMINGS))
def test_what_is_sealed_is_unsealed(body: bytes, form: tuple[Framing, Check]) -> None:
    assert unseal(seal(body, *form), *form) == body


@given(
    body=st.binary(min_size=2, max_size=20),
    bit=st.integers(min_value=0),
    form=st.sampled_from((("rtu", "crc"), ("rtu", "sum"))),
)
def test_one_flipped_bit_is_always_noticed(body: bytes, bit: int, form: tuple[Framing, Check]) -> None:
    frame = bytearray(seal(body, *form))
    bit %= 8 * len(frame)
    frame[bit // 8] ^= 1 << bit % 8
    assert unseal(bytes(frame), *form) is None


@pytest.mark.parametrize(
    "frame",
    [b"", b":", b":0103\r\n", b":0103FC", b"0103FC\r\n", b":01 03FC\r\n", b":01G3FC\r\n", b":0103F\r\n", b":01FF\r\n"],
)
def test_what_is_no_ascii_frame_has_no_body(frame: bytes) -> None:
    assert unseal(frame, "ascii") is None


def test_a_colon_begins_an_ascii_frame_anew() -> None:
    assert unseal(b":0103" + seal(b"\x01\x03\x02", "ascii"), "ascii") == b"\x01\x03\x02"


def test_a_bare_check_is_no_rtu_frame() -> None:
    assert unseal(seal(b"\x01"), "rtu") is None


@pytest.mark.parametrize(
    ("shape", "character", "t15", "t35"),
    [
        (Format(9600), 1_041_666, 1_562_500, 3_645_833),
        (Format(19200), 520_833, 781_250, 1_822_916),
        (Format(115200), 86_805, 750_000, 1_750_000),
        (Format(38400), 260_416, 750_000, 1_750_000),
        (Format(9600, parity="even"), 1_145_833, 1_718_750, 4_010_416),
        (Format(9600, 7), 937_500, 1_406_250, 3_281_250),
    ],
)
def test_the_times_are_those_of_the_specification(shape: Format, character: int, t15: int, t35: int) -> None:
    assert (shape.character, shape.t15, shape.t35) == (character, t15, t35)


@given(characters=st.integers(min_value=1, max_value=2 * LONGEST_FRAME), pause=st.sampled_from((0, 1, 700_000)))
def test_characters_follow_each_other_without_an_error_that_grows(characters: int, pause: int) -> None:
    shape = Format(9600, parity="odd")
    ends = shape.ends(SECOND, characters, pause)
    assert len(ends) == characters
    assert ends[-1] - SECOND == characters * 11 * SECOND // 9600 + (characters - 1) * pause


@given(data=st.binary(min_size=1, max_size=40))
def test_bytes_at_the_wrong_rate_never_hold_a_function(data: bytes) -> None:
    assert len(misheard(data)) == len(data)
    assert not set(misheard(data)) & {3, 4, 6, 0x83, 0x84, 0x86}
