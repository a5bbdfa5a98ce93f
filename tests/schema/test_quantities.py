"""Durations and sizes as people write them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.schema.quantities import duration_text, seconds, size, size_text


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("250ms", 0.25),
        ("1s", 1.0),
        ("1.5s", 1.5),
        ("5m", 300.0),
        ("24h", 86400.0),
        ("7d", 604800.0),
        ("0ms", 0.0),
        ("0.1ms", 0.0001),
        (0, 0.0),
        (2, 2.0),
        (0.25, 0.25),
    ],
)
def test_a_duration_is_a_number_of_seconds_or_text_of_one_decimal_and_one_unit(written: object, meant: float) -> None:
    assert seconds(written) == meant


@pytest.mark.parametrize(
    "written",
    [
        "",
        "1",
        "1 s",
        " 1s",
        "1s\n",
        "1sec",
        "1m30s",
        "-1s",
        "+1s",
        ".5s",
        "1.s",
        "1e3s",
        "1_0s",
        "٣s",
        "1S",
        "9" * 21 + "s",
        -1,
        -0.5,
        math.inf,
        math.nan,
        True,
        False,
        None,
        [],
        {},
        10**400,
    ],
)
def test_anything_else_is_no_duration(written: object) -> None:
    with pytest.raises(ValueError, match=r"^$"):
        seconds(written)


def test_minus_zero_is_zero() -> None:
    assert math.copysign(1.0, seconds(-0.0)) == 1.0


@pytest.mark.parametrize(
    ("duration", "text"),
    [
        (0.0, "0s"),
        (0.25, "250ms"),
        (0.0005, "0.5ms"),
        (1.0, "1s"),
        (1.5, "1.5s"),
        (90.0, "90s"),
        (60.0, "1m"),
        (3600.0, "1h"),
        (86400.0, "24h"),
        (172800.0, "2d"),
        (5400.0, "90m"),
        (1000.0, "1000s"),
    ],
)
def test_a_duration_is_written_in_the_largest_unit_that_divides_it(duration: float, text: str) -> None:
    assert duration_text(duration) == text


@given(st.floats(0, 1e9) | st.integers(0, 10**9).map(lambda n: n / 1000))
def test_a_duration_reads_back_as_itself(duration: float) -> None:
    text = duration_text(duration)
    if len(text) <= 22:  # longer ones are refused: nobody writes twenty decimals
        assert seconds(text) == duration


@pytest.mark.parametrize(
    ("written", "meant"),
    [("512MB", 512_000_000), ("1.5kB", 1500), ("1KB", 1000), ("2GB", 2 * 10**9), ("1TB", 10**12), ("7B", 7), (42, 42)],
)
def test_a_size_is_a_number_of_bytes_or_text_in_powers_of_1000(written: object, meant: int) -> None:
    assert size(written) == meant


@pytest.mark.parametrize(
    "written", ["", "512", "512 MB", "512MiB", "512M", "0.5B", "1.0005kB", -1, 1.0, True, None, 10**16]
)
def test_anything_else_is_no_size(written: object) -> None:
    with pytest.raises(ValueError, match=r"^$"):
        size(written)


@given(st.integers(0, 10**15))
def test_a_size_reads_back_as_itself(count: int) -> None:
    assert size(size_text(count)) == count


@pytest.mark.parametrize(
    ("count", "text"), [(0, "0B"), (999, "999B"), (1000, "1kB"), (512_000_000, "512MB"), (2_000_000_000, "2GB")]
)
def test_a_size_is_told_in_the_largest_unit_that_is_exact(count: int, text: str) -> None:
    assert size_text(count) == text
