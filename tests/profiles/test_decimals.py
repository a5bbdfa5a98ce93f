"""Numbers in decimals, against exact fractions."""

from __future__ import annotations

import struct
from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from lfs10d.profiles.decimals import Linear, float_of, shortest, span, spell


def float_bits(number: float) -> int:
    return int.from_bytes(struct.pack(">f", number), "big")


def nearest_shortest(bits: int) -> float:
    """Find the shortest decimal of a positive normal float32 by exact fractions: every length, both neighbours."""
    exponent, mantissa = (bits >> 23) - 127 - 23, bits & 0x7FFFFF | 0x800000
    exact = mantissa * Fraction(2) ** exponent
    above = exact + Fraction(2) ** exponent / 2
    narrow = bits & 0x7FFFFF == 0 and bits >> 23 > 1
    below = exact - Fraction(2) ** exponent / (4 if narrow else 2)
    even = mantissa % 2 == 0
    magnitude = len(str(int(exact))) if exact >= 1 else -len(str(int(1 / exact))) + 1
    for digits in range(1, 10):
        fits = []
        for guess in (magnitude - 1, magnitude, magnitude + 1):
            unit = Fraction(10) ** (guess - digits)
            fits += [
                (abs(count * unit - exact), count % 2, count * unit)
                for count in (exact // unit, exact // unit + 1)
                if len(str(count)) <= digits
                and (below < count * unit < above or (even and count * unit in {below, above}))
            ]
        if fits:
            return float(min(fits)[2])  # of two as near the even one
    raise AssertionError(hex(bits))


normal_floats = st.integers(0x0080_0000, 0x7F7F_FFFF)


@given(bits=normal_floats)
@example(bits=0x7F7F_FFFF)
@example(bits=0x0080_0000)
@example(bits=0x0080_0001)
@example(bits=0x4A1C_21EF)  # 2558075.75 lies in the middle of 2558075.7 and 2558075.8
def test_the_decimal_of_a_float32_is_the_shortest_that_reads_back(bits: int) -> None:
    number = shortest(bits)
    assert float_bits(number) == bits
    assert number == nearest_shortest(bits)
    assert shortest(bits | 0x8000_0000) == -number


@pytest.mark.parametrize("exponent", range(1, 255))
def test_the_decimal_of_a_power_of_two_is_the_shortest_though_the_floats_below_it_lie_closer(exponent: int) -> None:
    bits = exponent << 23
    assert shortest(bits) == nearest_shortest(bits)
    assert shortest(bits | 0x8000_0000) == -nearest_shortest(bits)


@pytest.mark.parametrize(
    ("low", "high", "unit", "text"),
    [
        (0, 100, "m/s", "0..100 m/s"),
        (-0.5, 7.25, "1", "-0.5..7.25"),
        (None, 3.0, "Hz", "..3 Hz"),
        (3, None, "Hz", "3.. Hz"),
        (None, None, "Hz", "any"),
    ],
)
def test_a_range_is_spelled_for_people(low: float | None, high: float | None, unit: str, text: str) -> None:
    assert span(low, high, unit) == text


@pytest.mark.parametrize(
    ("number", "unit", "text"),
    [(140.2, "m/s", "140.2 m/s"), (100.0, "m/s", "100 m/s"), (7, "1", "7"), (1e22, "1", "1" + "0" * 22)],
)
def test_a_number_is_spelled_with_its_unit(number: float, unit: str, text: str) -> None:
    assert spell(number, unit) == text


DECIMALS = st.sampled_from([1, -1, 0.1, 0.01, 2.5, 10, 1e-6])


@given(raw=st.integers(-(2**63), 2**64), scale=DECIMALS, offset=st.sampled_from([0, -40, 0.5, 273.15]))
def test_a_scaled_integer_is_the_float_nearest_to_the_decimal_result(raw: int, scale: float, offset: float) -> None:
    exact = raw * Fraction(repr(scale)) + Fraction(repr(offset))
    number = Linear.of(scale, offset).of_integer(raw)
    assert number == (
        int(exact) if Fraction(repr(scale)).denominator == Fraction(repr(offset)).denominator == 1 else float(exact)
    )


def test_a_scaled_float_is_scaled_as_the_decimal_it_prints_as() -> None:
    assert Linear.of(0.1, 0).of_decimal(12.3) == 1.23
    assert Linear.of(1, -40).of_decimal(66.2) == 26.2


def test_only_a_scale_of_one_without_an_offset_changes_nothing() -> None:
    assert Linear.of(1, 0).plain
    assert not Linear.of(1, 0.5).plain
    assert not Linear.of(2, 0).plain


@given(number=st.floats(width=32, allow_nan=False))
def test_bits_of_a_float_are_that_float(number: float) -> None:
    assert float_of(float_bits(number), "float32") == number
    assert float_of(int.from_bytes(struct.pack(">d", number), "big"), "float64") == number
