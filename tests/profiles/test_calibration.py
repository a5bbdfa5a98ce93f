"""A calibrated number is what the certificate says, to seven digits, and never a long tail of them."""

from __future__ import annotations

from fractions import Fraction
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.profiles.calibration import DIGITS, Calibration
from lfs10d.profiles.decimals import shortest

SCALES = st.floats(0.5, 2).map(lambda scale: round(scale, 5))
OFFSETS = st.floats(-10, 10).map(lambda offset: round(offset, 3))


@pytest.mark.parametrize(
    ("number", "scale", "offset", "calibrated"),
    [
        (12.99, 1.013, 0.06, "13.21887"),
        (12.99, 1.0137, 0.061, "13.22896"),
        (12.99, 1.0, 0.0, "12.99"),
        (0.1, 3, 0, "0.3"),
        (7.3, 1.013, 0.06, "7.4549"),
        (1.1, 1.1, 0.0, "1.21"),
        (123456.78, 1.0, 0.013, "123456.79"),
        (12345678.5, 1.0001, 0, "12346913.1"),
        (350, 1, 15, "365"),
        (350, 1.0, 15.0, "365"),
        (350, 1.5, 0.0, "525.0"),
        (2**64 - 1, 3, 1, str(3 * (2**64 - 1) + 1)),
        (5, 0.1, 0, "0.5"),
        (0, 2.5, 0.5, "0.5"),
        (-0.0, 1.013, 0.06, "0.06"),
        (0.06, 1.0, -0.06, "0.0"),
        (1e300, 1.5, 0.0, "1.5e+300"),
        (1.5e-9, 1.013, 0.0, "1.5195e-09"),
    ],
)
def test_a_certificate_is_applied_in_decimals(number: float, scale: float, offset: float, calibrated: str) -> None:
    assert repr(Calibration(scale, offset).apply(number)) == calibrated


@pytest.mark.parametrize("rest", [0, 0.0, -0.0])
def test_no_wind_is_no_wind_whatever_the_certificate_adds(rest: float) -> None:
    assert repr(Calibration(1.013, 0.06, keeps_zero=True).apply(rest)) == repr(rest)
    assert Calibration(1.013, 0.06, keeps_zero=True).apply(0.01) == 0.07013


def test_what_is_too_large_is_infinite() -> None:
    assert Calibration(1e12, 0.0).apply(1.7e308) == inf


@given(st.integers(0, 10**7).map(lambda bits: 0x3C00_0000 + 9 * bits), SCALES, OFFSETS)
def test_it_is_right_to_seven_digits_and_has_no_longer_tail(bits: int, scale: float, offset: float) -> None:
    number = shortest(bits)
    calibrated = Calibration(scale, offset).apply(number)
    exact = Fraction(repr(number)) * Fraction(repr(scale)) + Fraction(repr(offset))
    assert abs(Fraction(repr(calibrated)) - exact) <= abs(exact) / 10 ** (DIGITS - 1) / 2
    decimals = [len(repr(each).partition(".")[2]) if "e" not in repr(each) else 0 for each in (number, calibrated)]
    digits = len(repr(calibrated).lstrip("-0.").replace(".", "").partition("e")[0].rstrip("0"))
    assert digits <= DIGITS or decimals[1] <= decimals[0]


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(0.5, 2), st.floats(-10, 10))
def test_more_stays_more(one: float, other: float, scale: float, offset: float) -> None:
    calibration = Calibration(scale, offset)
    low, high = sorted((one, other))
    least = abs(scale * low + offset) / 10**DIGITS
    assert calibration.apply(low) <= calibration.apply(high) + least


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(1e-12, 1e12), st.floats(-1e12, 1e12))
def test_any_finite_number_has_a_calibrated_one(number: float, scale: float, offset: float) -> None:
    calibrated = Calibration(scale, offset).apply(number)
    assert isinstance(calibrated, float)
    assert calibrated == calibrated  # noqa: PLR0124 - not a NaN
