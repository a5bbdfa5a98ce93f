"""A sample comes back from the store as it was, to the bit."""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.outbox.store.row import (
    Cell,
    DamagedError,
    Series,
    beyond_first_schema,
    check,
    content_of,
    pack,
    pack_aged,
    pack_rtt,
    unpack,
    unpack_rtt,
    values_of,
)
from lfs10d.profiles.decimals import shortest
from lfs10d.reading import FaultCode, Value
from lfs10d.telemetry.publication import Quality, Sample

VALUE_ERRORS = ("unavailable", "not_finite", "out_of_range", "exception")
VALUES: st.SearchStrategy[Value] = st.one_of(
    st.integers(), st.floats(allow_nan=False, allow_infinity=False), st.booleans(), st.text()
)
FLOAT32_BITS = st.integers(0, 2**32 - 1).filter(lambda bits: 0 < bits >> 23 & 0xFF < 0xFF or not bits & 0x7FFFFFFF)


def series(**changes: object) -> Series:
    usual = Series("k1", "mast", "good", None, ("a", "b"), (("a", "m/s"),), repeated=False)
    return replace(usual, **changes)  # type: ignore[arg-type]  # the test says which are changed


def value_of(cell: Cell) -> Any:  # noqa: ANN401 - a value of any type
    """Return the value of a cell that has neither error nor age."""
    value, error, age = unpack(cell)
    assert (error, age) == (None, None)
    return value


@given(FLOAT32_BITS)
def test_every_float32_comes_back_bit_identical_from_four_bytes(bits: int) -> None:
    number = shortest(bits)
    cell = pack(number)
    assert isinstance(cell, bytes)
    assert len(cell) == 4
    back = value_of(cell)
    assert (back, repr(back)) == (number, repr(number))
    assert struct.unpack("<I", struct.pack("<f", back))[0] == bits


@given(VALUES)
def test_any_value_comes_back_as_it_was_and_of_its_type(number: float) -> None:
    back = value_of(pack(number))
    assert (type(back), repr(back)) == (type(number), repr(number))


def test_a_scaled_number_of_few_digits_takes_four_bytes() -> None:
    assert isinstance(pack(50.03), bytes)
    assert value_of(pack(50.03)) == 50.03


@given(VALUES, st.integers(0, 10**12))
def test_a_value_and_its_age_come_back(value: Value, ms: int) -> None:
    back, error, age = unpack(pack_aged(value, ms / 1000))
    assert (type(back), repr(back), error, age) == (type(value), repr(value), None, ms / 1000)


@pytest.mark.parametrize(
    ("value", "size"), [(True, 1), (False, 1), ("rain", 6), ("", 2), (0.1, 4), (10**20, 21)], ids=str
)
def test_a_value_takes_few_bytes(value: Value, size: int) -> None:
    cell = pack(value)
    assert isinstance(cell, bytes | str)
    assert len(cell) == size


@pytest.mark.parametrize(
    "cell",
    [
        b"",
        b"123",
        b"\6",
        "1.5",
        "x",
        "true",
        "null",
        "7",
        "NaN",
        "[5,NaN]",
        "[5,Infinity]",
        "[5, 1]",
        "[5]",
        "[true,1]",
        "[1.5,1]",
        "[5,null]",
        "[5,[1]]",
        "{}",
        f"[{10**400},1]",
        '"\\u0041"',
        "[" * 100_000,
    ],
    ids=lambda cell: repr(cell)[:20],
)
def test_a_cell_that_holds_no_value_is_damage(cell: bytes | str) -> None:
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
    assert content_of(series(), values_of(good)).values == {"b": 3}
    bad = Sample("mast", "k1", 1, 0, "synced", None, units, ("a", "b"), "bad", "crc", None)
    assert values_of(bad) == ()
    assert content_of(series(quality="bad", error="crc"), (None,)).values is None


@given(
    st.lists(st.one_of(VALUES, st.tuples(VALUES, st.integers(0, 10**9)), st.sampled_from(VALUE_ERRORS).map(FaultCode)))
)
def test_any_mixture_of_values_ages_and_errors_comes_back(kinds: list[Any]) -> None:
    names = tuple(f"v{place}" for place in range(len(kinds)))
    errors = {name: kind for name, kind in zip(names, kinds, strict=True) if isinstance(kind, FaultCode)}
    ages = {name: kind[1] / 1000 for name, kind in zip(names, kinds, strict=True) if isinstance(kind, tuple)}
    values = {
        name: None if isinstance(kind, FaultCode) else kind[0] if isinstance(kind, tuple) else kind
        for name, kind in zip(names, kinds, strict=True)
    }
    quality: Quality = "partial" if errors else "good"
    sample = Sample("mast", "k1", 1, 0, "synced", values, {}, names, quality, None, 1.0, errors, ages)
    content = content_of(Series.of(sample, repeated=False), values_of(sample))
    assert (repr(content.values), dict(content.errors), dict(content.ages)) == (repr(values), errors, ages)


def test_why_a_value_is_missing_takes_one_byte_and_no_series_of_its_own() -> None:
    values: dict[str, Value | None] = {"a": None, "b": 3}
    one, other = (
        Sample("mast", "k1", 1, 0, "synced", values, {}, ("a", "b"), "partial", None, 1.0, {"a": code})
        for code in (FaultCode.UNAVAILABLE, FaultCode.EXCEPTION)
    )
    assert Series.of(one, repeated=False) == Series.of(other, repeated=False)
    assert [len(cell) for cell in (values_of(one)[0], values_of(other)[0]) if isinstance(cell, bytes)] == [1, 1]


@pytest.mark.parametrize("cell", [pack("5"), pack(value=True), pack_aged(5, 1.0), b"\2"], ids=repr)
def test_what_an_earlier_lfs10d_cannot_read_is_told(cell: Cell) -> None:
    assert beyond_first_schema((1, cell))
    assert not beyond_first_schema((None, 1, 1e300, pack(12.99), pack(10**30), pack(-(10**30))))


def test_minus_zero_keeps_its_sign() -> None:
    back = value_of(pack(-0.0))
    assert isinstance(back, float)
    assert math.copysign(1, back) == -1
