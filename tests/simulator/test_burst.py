"""Two speakers at once."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from lfs10d.simulator.burst import NOISE, Burst, as_heard, collide
from lfs10d.simulator.wire import Format

SHAPE = Format(9600)
CHARACTER = SHAPE.character


def burst(data: bytes, start: int = 0, shape: Format = SHAPE) -> Burst:
    return Burst(NOISE, start, bytearray(data), shape.ends(start, len(data)), shape)


def test_equal_bytes_at_the_same_time_pass_unharmed() -> None:
    one, other = burst(b"same"), burst(b"same")
    collide(one, other)
    assert (bytes(one.data), one.struck) == (b"same", False)
    assert (bytes(other.data), other.struck) == (b"", False)


def test_different_bytes_at_the_same_time_are_mangled_where_they_differ() -> None:
    one, other = burst(b"\x01\x0f\x01"), burst(b"\x01\xf0")
    collide(one, other)
    assert one.data == b"\x01\x00\x01"
    assert one.struck
    assert other.struck


def test_of_a_longer_one_at_the_same_time_the_rest_comes_through() -> None:
    one, other = burst(b"ab"), burst(b"abcd")
    collide(one, other)
    assert one.data + other.data == b"abcd"


@given(first=st.binary(min_size=1, max_size=12), second=st.binary(min_size=1, max_size=12), shift=st.integers(1, 20))
def test_the_later_loses_what_overlaps_and_mangles_the_earlier(first: bytes, second: bytes, shift: int) -> None:
    start = shift * CHARACTER // 2 + 7
    one, other = burst(first), burst(second, start)
    end = one.ends[-1]
    collide(other, one)
    if start >= end:
        assert (bytes(one.data), bytes(other.data), one.struck) == (first, second, False)
        return
    untouched = sum(end <= start for end in one.ends)
    assert one.data[:untouched] == first[:untouched]
    assert one.struck
    assert other.struck
    assert other.data == second[len(second) - len(other.data) :]
    assert all(begun - CHARACTER >= end for begun in other.ends[:1])
    assert len(other.data) == len(other.ends)


def test_a_cut_burst_ends_with_the_last_whole_byte() -> None:
    one = burst(b"abcd")
    one.cut(one.ends[1] + 5)
    assert (bytes(one.data), one.struck) == (b"ab", True)
    one.cut(one.ends[1])
    assert one.data == b"ab"


def test_a_burst_that_was_over_is_not_struck_by_a_cut() -> None:
    one = burst(b"ab")
    one.cut(one.ends[-1])
    assert (bytes(one.data), one.struck) == (b"ab", False)


def test_at_another_rate_bytes_are_noise() -> None:
    assert as_heard(burst(b"\x01\x03"), SHAPE, 1, 2) == b"\x03"
    assert as_heard(burst(b"\x01\x03"), Format(19200), 0, 2) not in {b"\x01\x03", b""}
