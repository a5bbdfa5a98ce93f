"""A sample comes back from the store as it was, to the bit."""

from __future__ import annotations

import math
import struct
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.outbox.store.row import (
    DamagedError,
    Series,
    check,
    pack,
    pack_rtt,
    unpack,
    unpack_rtt,
    values_from,
    values_of,
)
from lfs10d.profiles.registers import shortest
from lfs10d.telemetry.publication import Sample

FLOAT32_BITS = st.integers(0, 2**32 - 1).filter(lambda bits: 0 < bits >> 23 & 0xFF < 0xFF or not bits & 0x7FFFFFFF)


def series(**changes: object) -> Series:
    usual = Series("k1", "mast", "good", None, ("a", "b"), (("a", "m/s"),), repeated=False)
    return replace(usual, **changes)  # type: ignore[arg-type]  # the test says which are changed


@given(FLOAT32_BITS)
def test_every_float32_comes_back_bit_identical_from_four_bytes(bits: int) -> None:
    number = shortest(bits)
    cell = pack(number)
    assert isinstance(cell, bytes)
    assert len(cell) == 4
    back = unpack(cell)
    assert (back, repr(back)) == (number, repr(number))
    assert struct.unpack("<I", struct.pack("<f", back))[0] == bits


@given(st.one_of(st.integers(), st.floats(allow_nan=False, allow_infinity=False)))
def test_any_number_comes_back_as_it_was_and_of_its_type(number: float) -> None:
    back = unpack(pack(number))
    assert (type(back), repr(back)) == (type(number), repr(number))


def test_a_scaled_number_of_few_digits_takes_four_bytes() -> None:
    assert isinstance(pack(50.03), bytes)
    assert unpack(pack(50.03)) == 50.03


@pytest.mark.parametrize("cell", [b"", b"123", "1.5", "x"])
def test_a_cell_that_holds_no_number_is_damage(cell: bytes | str) -> None:
    with pytest.raises(DamagedError):
        unpack(cell)


@given(st.integers(0, 10_000_000))
def test_a_round_trip_in_tenths_is_kept_as_an_integer(tenths: int) -> None:
    assert pack_rtt(tenths / 10) == tenths
    assert unpack_rtt(tenths) == tenths / 10


@given(st.floats(0, 1e6))
def test_any_round_trip_comes_back(rtt_ms: float) -> None:
    assert unpack_rtt(pack_rtt(rtt_ms)) == rtt_ms


def test_no_round_trip_is_none() -> None:
    assert unpack_rtt(pack_rtt(None)) is None
    with pytest.raises(DamagedError):
        unpack_rtt("x")


@pytest.mark.parametrize("changes", [{}, {"quality": "bad", "error": "timeout"}, {"units": ()}, {"repeated": True}])
def test_a_series_comes_back_from_its_text(changes: dict[str, object]) -> None:
    assert Series.parse(series(**changes).text) == series(**changes)


def test_samples_of_one_series_have_device_boot_quality_error_names_and_units_in_common() -> None:
    good = Sample("mast", "k1", 1, 0, "synced", {"a": 3, "b": 1}, {"a": "m/s"}, ("a", "b"), "good", None, 1.0)
    assert Series.of(good, repeated=False) == series()
    assert Series.of(replace(good, seq=9, ts=9, rtt_ms=None), repeated=False) == series()
    assert Series.of(good, repeated=True) == series(repeated=True)


@pytest.mark.parametrize("text", ["", "[]", "null", "[1,2,3,4,5,6,7]", series().text + " "])
def test_a_text_that_is_no_series_is_damage(text: str) -> None:
    with pytest.raises(DamagedError):
        Series.parse(text)


def test_the_check_tells_any_fact_from_another() -> None:
    assert check("s", 1, 2, b"abcd") == check("s", 1, 2, b"abcd")
    others = [check("t", 1, 2, b"abcd"), check("s", 1, 3, b"abcd"), check("s", 1, 2, b"abc\0"), check("s", 1, 2)]
    assert check("s", 1, 2, b"abcd") not in others


@given(st.integers(), st.binary())
def test_a_check_takes_two_bytes(number: int, data: bytes) -> None:
    assert -(2**15) <= check("s", number, data) < 2**15


def test_values_that_are_missing_stay_missing_and_bad_samples_have_none() -> None:
    units = {"a": "m/s", "b": "1"}
    good = Sample("mast", "k1", 1, 0, "synced", {"b": 3}, units, ("a", "b"), "good", None, 1.0)
    assert values_of(good) == (None, 3)
    assert values_from(series(), values_of(good)) == {"b": 3}
    bad = Sample("mast", "k1", 1, 0, "synced", None, units, ("a", "b"), "bad", "crc", None)
    assert values_of(bad) == ()
    assert values_from(series(quality="bad", error="crc"), (None,)) is None


def test_minus_zero_keeps_its_sign() -> None:
    back = unpack(pack(-0.0))
    assert isinstance(back, float)
    assert math.copysign(1, back) == -1
