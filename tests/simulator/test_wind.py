"""Where simulated values come from."""

from __future__ import annotations

import struct

from hypothesis import given
from hypothesis import strategies as st

from lfs10d.simulator.wind import UNIQUE_VALUES, Unique, Wind
from lfs10d.simulator.wire import SECOND


def test_unique_values_do_not_repeat_and_stay_in_range() -> None:
    source = Unique()
    values = [source(0) for _ in range(50_000)]
    assert len(set(values)) == len(values)
    assert 0 <= min(values) <= max(values) < 100


@given(drawn=st.integers(min_value=0, max_value=2 * UNIQUE_VALUES))
def test_a_unique_value_survives_a_float32(drawn: int) -> None:
    source = Unique()
    source.drawn = drawn
    value = source(0)
    (read,) = struct.unpack(">f", struct.pack(">f", value))
    assert round(read, 4) == value


def test_the_wind_of_one_seed_is_always_the_same_and_moves() -> None:
    one, same, other = Wind(3), Wind(3), Wind(4)
    times = [n * SECOND // 4 for n in range(400)]
    assert [one(time) for time in times] == [same(time) for time in times]
    assert [one(time) for time in times] != [other(time) for time in times]
    assert len({one(time) for time in times}) > 100


@given(seed=st.integers(min_value=0, max_value=1000), time=st.integers(min_value=0, max_value=10**15))
def test_wind_is_never_negative_and_has_two_decimals(seed: int, time: int) -> None:
    speed = Wind(seed)(time)
    assert 0 <= speed < 30
    assert round(speed, 2) == speed
