"""The time of wind statistics."""

from __future__ import annotations

from lfs10d.system.clock import Instant
from lfs10d.telemetry.wind.clock import EVEN_WITHIN, WindClock

WALL = 1_795_298_000.0


def seen(mono: float, ahead: float = 0.0) -> Instant:
    return Instant(mono, WALL + mono + ahead, "synced")


def test_times_differ_as_the_ts_of_the_samples_do() -> None:
    clock = WindClock(seen(100.0))
    readings = [(100.0004, seen(100.001)), (100.25049, seen(100.2506, 0.0003)), (100.7, seen(100.71, -0.004))]
    times = [clock.at(at, now) for at, now in readings]
    ts = [now.ts(at) for at, now in readings]
    assert [after - times[0] for after in times] == [after - ts[0] for after in ts]
    assert times[0] == 100_000


def test_a_clock_that_is_set_moves_no_time() -> None:
    clock = WindClock(seen(100.0))
    assert clock.at(100.0, seen(100.0)) == 100_000
    assert clock.at(100.25, seen(100.25, 3600.0)) == 100_250
    assert clock.at(100.5, seen(100.5, -86_400.0)) == 100_500


def test_a_moment_tells_the_wall_clock_and_how_far_it_is_ahead() -> None:
    clock = WindClock(seen(100.0))
    moment = clock.moment(seen(101.0, 3600.0))
    assert (moment.at, moment.ts) == (101_000, round((WALL + 101.0 + 3600.0) * 1000))
    assert moment.shift == round((WALL + 3600.0) * 1000)
    assert moment.clock == "synced"


def test_a_clock_that_is_slewed_is_followed_before_it_is_far_away() -> None:
    clock = WindClock(seen(0.0))
    for second in range(1000):
        ahead = second * 0.0005
        assert abs(clock.moment(seen(second, ahead)).at - second * 1000) <= EVEN_WITHIN
