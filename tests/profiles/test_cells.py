"""Registers to values, against decoders written here with other means."""

from __future__ import annotations

import struct
from dataclasses import replace
from fractions import Fraction
from itertools import product

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from lfs10d.profiles.calibration import Calibration
from lfs10d.profiles.cells import Cell
from lfs10d.profiles.decimals import Linear
from lfs10d.profiles.register_types import WORDS, ByteOrder, RegisterType, WordOrder
from lfs10d.reading import Fault, FaultCode

FORMATS: dict[RegisterType, str] = {"int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f"}
WIRE_ORDER: dict[tuple[WordOrder, ByteOrder], str] = {
    ("high_first", "big"): "ABCD",
    ("high_first", "little"): "BADC",
    ("low_first", "big"): "CDAB",
    ("low_first", "little"): "DCBA",
}
FIRST_MEASURABLE = 0x3586_37BD
"""Bits of the float32 nearest to 1e-6, the smallest magnitude that is a measurement."""
_MAGNITUDES = st.one_of(st.just(0), st.integers(FIRST_MEASURABLE, 0x7F7F_FFFF))
MEASURABLE = st.builds(
    lambda bits, sign: struct.unpack(">f", struct.pack(">I", bits | sign << 31))[0], _MAGNITUDES, st.integers(0, 1)
)

LAYOUTS = [
    (kind, word_order, byte_order)
    for kind, (word_order, byte_order) in product(FORMATS, WIRE_ORDER)
    if WORDS[kind] > 1 or word_order == "high_first"
]


def cell(
    kind: RegisterType,
    word_order: WordOrder = "high_first",
    byte_order: ByteOrder = "big",
    *,
    offset: int = 0,
    linear: Linear | None = None,
    low: float | None = None,
    high: float | None = None,
) -> Cell:
    signed = 1 << 16 * WORDS[kind] - 1 if kind.startswith("int") else 0
    place = Cell("wind", "m/s", offset, kind, word_order, byte_order, linear or Linear(1, 0, 1), low, high)
    return replace(place, words=WORDS[kind], signed_from=signed)


def registers_of(kind: RegisterType, word_order: WordOrder, byte_order: ByteOrder, number: float) -> tuple[int, ...]:
    """Lay a number out as bytes, shuffle them as the layout's name says, cut them into registers."""
    straight = struct.pack(">" + FORMATS[kind], number)
    letters = WIRE_ORDER[word_order, byte_order] if len(straight) > 2 else {"big": "AB", "little": "BA"}[byte_order]
    wire = bytes(straight["ABCD".index(letter)] for letter in letters)
    return struct.unpack(f">{len(wire) // 2}H", wire)


@pytest.mark.parametrize(
    ("registers", "number"),
    [((0x414F, 0xD70A), 12.99), ((0x0000, 0x0000), 0.0), ((0x42C8, 0x0000), 100.0), ((0x3DCC, 0xCCCD), 0.1)],
)
def test_a_float32_becomes_the_decimal_that_a_person_would_write(registers: tuple[int, int], number: float) -> None:
    assert repr(cell("float32").decode(registers)) == repr(number)


def test_the_low_word_first_layout_of_the_laser_reads_53493() -> None:
    assert cell("int32", "low_first").decode((0xD0F5, 0x0000)) == 53493


def test_minus_zero_stays_what_the_sensor_sent() -> None:
    assert repr(cell("float32", low=0, high=100).decode((0x8000, 0x0000))) == "-0.0"


@pytest.mark.parametrize(("kind", "word_order", "byte_order"), LAYOUTS)
@given(data=st.data(), offset=st.integers(0, 3))
def test_every_layout_reads_what_an_independent_decoder_laid_out(
    kind: RegisterType, word_order: WordOrder, byte_order: ByteOrder, offset: int, data: st.DataObject
) -> None:
    bits = 16 * WORDS[kind]
    if kind == "float32":
        number: float = data.draw(MEASURABLE)
    elif kind.startswith("u"):
        number = data.draw(st.integers(0, 2**bits - 1))
    else:
        number = data.draw(st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1))
    registers = (0xDEAD,) * offset + registers_of(kind, word_order, byte_order, number) + (0xBEEF,)
    decoded = cell(kind, word_order, byte_order, offset=offset).decode(registers)
    assert not isinstance(decoded, Fault)
    assert type(decoded) is type(number)
    assert struct.pack(">" + FORMATS[kind], decoded) == struct.pack(">" + FORMATS[kind], number)


@given(
    raw=st.integers(-(2**31), 2**31 - 1),
    scale=st.decimals(-100, 100, places=6).filter(bool),
    offset=st.decimals(-1000, 1000, places=3),
)
@example(raw=5003, scale=0.01, offset=0)
def test_a_scaled_integer_is_the_float_nearest_to_the_decimal_result(
    raw: int, scale: Fraction, offset: Fraction
) -> None:
    factor, shift = float(scale), float(offset)
    registers = registers_of("int32", "high_first", "big", raw)
    number = cell("int32", linear=Linear.of(factor, shift)).decode(registers)
    assert number == float(Fraction(repr(factor)) * raw + Fraction(repr(shift)))


@pytest.mark.parametrize(
    ("raw", "scale", "offset", "number"),
    [
        (5000, 0.01, 0.0, "50.0"),
        (5003, 0.01, 0.0, "50.03"),
        (1299, 0.01, 0.0, "12.99"),
        (7, 1.0, 0.0, "7"),
        (7, 10.0, -1.0, "69"),
        (3, 0.1, 0.2, "0.5"),
        (65535, -0.5, 0.0, "-32767.5"),
    ],
)
def test_a_scaled_integer_prints_as_a_person_would_calculate_it(
    raw: int, scale: float, offset: float, number: str
) -> None:
    assert repr(cell("uint16", linear=Linear.of(scale, offset)).decode((raw,))) == number


def test_a_scaled_float32_is_scaled_as_the_decimal_it_prints_as() -> None:
    assert cell("float32", linear=Linear.of(3.6, 0.0)).decode((0x414F, 0xD70A)) == 46.764
    assert cell("float32", linear=Linear.of(1.0, -0.99)).decode((0x414F, 0xD70A)) == 12.0


@pytest.mark.parametrize(
    ("bits", "message"),
    [
        (0x7FC0_0000, "wind is not a number (NaN): 0x7FC00000"),
        (0xFF80_0001, "wind is not a number (NaN): 0xFF800001"),
        (0x7F80_0000, "wind is infinite: 0x7F800000"),
        (0xFF80_0000, "wind is infinite: 0xFF800000"),
    ],
)
def test_what_is_no_finite_number_is_a_fault(bits: int, message: str) -> None:
    fault = cell("float32").decode((bits >> 16, bits & 0xFFFF))
    assert fault == Fault(FaultCode.NOT_FINITE, message)


@given(magnitude=st.integers(1, FIRST_MEASURABLE - 1), sign=st.sampled_from([0, 0x8000_0000]))
@example(magnitude=1, sign=0)  # a subnormal
@example(magnitude=0x00E1_0000, sign=0)  # a register of 225 read as half a float: 2.07e-38
@example(magnitude=FIRST_MEASURABLE - 1, sign=0)
def test_a_float32_below_a_millionth_is_out_of_range_for_integers_read_as_floats_look_so(
    magnitude: int, sign: int
) -> None:
    bits = magnitude | sign
    fault = cell("float32").decode((bits >> 16, bits & 0xFFFF))
    assert isinstance(fault, Fault)
    assert fault.code is FaultCode.OUT_OF_RANGE
    assert f"0x{bits:08X}" in fault.message
    assert "integer" in fault.message


@pytest.mark.parametrize(("bits", "number"), [(FIRST_MEASURABLE, 1e-6), (0, 0.0), (FIRST_MEASURABLE + 1, 1.0000001e-6)])
def test_zero_and_a_millionth_are_measurements(bits: int, number: float) -> None:
    assert cell("float32").decode((bits >> 16, bits & 0xFFFF)) == number


def test_a_small_integer_is_a_number_whatever_a_float_of_its_bits_would_be() -> None:
    assert cell("uint32").decode((0, 1)) == 1
    assert cell("uint16", linear=Linear.of(1e-9, 0)).decode((5,)) == 5e-9


@given(number=MEASURABLE)
@example(number=100.0)
@example(number=0.0)
@example(number=-0.0)
def test_a_number_is_believed_only_within_its_range_both_ends_included(number: float) -> None:
    decoded = cell("float32", low=0, high=100).decode(registers_of("float32", "high_first", "big", number))
    assert isinstance(decoded, Fault) is not (0 <= number <= 100)


def test_a_number_out_of_range_is_told_with_its_range() -> None:
    fault = cell("float32", low=0.0, high=100.0).decode((0x430C, 0x3333))
    assert fault == Fault(FaultCode.OUT_OF_RANGE, "wind 140.2 m/s is outside 0..100 m/s")


def test_the_range_is_of_the_scaled_number() -> None:
    tenths = cell("uint16", linear=Linear.of(0.1, 0.0), high=100)
    assert tenths.decode((1000,)) == 100.0
    assert isinstance(tenths.decode((1001,)), Fault)


def test_a_calibration_comes_before_the_range_and_after_the_scale() -> None:
    tenths = replace(cell("uint16", linear=Linear.of(0.1, 0.0), high=10), calibration=Calibration(1.1, 0.2))
    assert tenths.decode((71,)) == 8.01
    assert tenths.decode((90,)) == Fault(FaultCode.OUT_OF_RANGE, "wind 10.1 m/s is outside ..10 m/s")
    endless = replace(cell("uint16", linear=Linear.of(0.5, 0.0)), calibration=Calibration(1e308, 0.0))
    assert endless.decode((0xFFFF,)) == Fault(FaultCode.NOT_FINITE, "wind is infinite with its calibration")
