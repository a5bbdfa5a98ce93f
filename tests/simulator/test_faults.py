"""What ails a sensor, how often, and when."""

from __future__ import annotations

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.simulator.faults import ALWAYS, FaultKind, Window, window
from lfs10d.simulator.wire import SECOND
from tests.support.faulty_sensors import sensor_fault

TIMES = st.integers(min_value=0, max_value=1000)


@given(now=TIMES)
def test_without_times_it_is_always_there(now: int) -> None:
    assert ALWAYS.covers(now)
    assert ALWAYS.ended(now) == 0


@given(first=TIMES, now=TIMES)
def test_without_an_end_it_stays(first: int, now: int) -> None:
    assert Window(first).covers(now) == (now >= first)


@given(first=TIMES, length=st.integers(1, 100), pause=st.integers(1, 100), now=TIMES)
def test_a_window_that_repeats_is_one_of_many(first: int, length: int, pause: int, now: int) -> None:
    every = length + pause
    starts = range(first, 2100, every)
    repeated = Window(first, first + length, every)
    assert repeated.covers(now) == any(start <= now < start + length for start in starts)
    assert repeated.ended(now) == sum(start + length <= now for start in starts)


def test_a_window_that_does_not_repeat_ends_once() -> None:
    once = window(1.0, 2.0)
    times = (0, SECOND, 2 * SECOND, 9 * SECOND)
    assert [once.covers(time) for time in times] == [False, True, False, False]
    assert [once.ended(time) for time in times] == [0, 0, 1, 1]


def test_a_window_in_seconds_can_repeat() -> None:
    assert window(1.0, 2.0, 5.0) == Window(SECOND, 2 * SECOND, 5 * SECOND)


def test_a_rate_is_the_share_of_answers() -> None:
    random = Random(1)  # noqa: S311  # a repeatable draw
    one = sensor_fault("noisy", 0.25)
    assert 200 < sum(one.strikes(0, random) for _ in range(1000)) < 300


def test_outside_its_window_nothing_strikes() -> None:
    one = sensor_fault("noisy", first=5.0)
    assert not one.strikes(0, Random(1))  # noqa: S311  # a repeatable draw
    assert one.strikes(5 * SECOND, Random(1))  # noqa: S311  # a repeatable draw


def test_late_has_a_delay_of_its_own_unless_told() -> None:
    assert sensor_fault(FaultKind.LATE).delay == SECOND * 6 // 10
    assert sensor_fault(FaultKind.LATE, delay=0.1).delay == SECOND // 10
    assert sensor_fault(FaultKind.NOISY).delay == 0


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(ValueError, match="sleepy"):
        sensor_fault("sleepy")


def test_an_unknown_particular_is_refused() -> None:
    with pytest.raises(TypeError, match="colour"):
        sensor_fault("noisy", colour="red")
