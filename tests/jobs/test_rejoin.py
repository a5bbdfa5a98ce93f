"""Sensors of a change of rate that was cut short, or that wait for their power cycle."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from lfs10d.jobs.baudrate import Ended, RateVerdict, Sensor
from lfs10d.jobs.rejoin import CameUp, Twins, await_power, undo

if TYPE_CHECKING:
    from tests.jobs.conftest import Pretence

UP = (9600, 19200)


def undone(pretence: Pretence, *rates: int, finish: bool = False, **facts: Any) -> RateVerdict:  # noqa: ANN401  # passed on
    for slave, rate in enumerate(rates, 1):
        pretence.sensor(slave, baudrate=rate, **facts)
    sensors = [Sensor(f"s{slave}", slave, pretence.asking()) for slave in range(1, len(rates) + 1)]
    return pretence.carry_out(undo(sensors, *UP, longest_pause=15.0, finish=finish))


def test_what_was_cut_short_is_undone(pretence: Pretence) -> None:
    assert undone(pretence, 19200, 9600) == RateVerdict(Ended.ROLLED_BACK, {"s1": 9600, "s2": 9600})
    assert pretence.aside == []


def test_a_change_that_reached_all_is_finished_where_that_is_wanted(pretence: Pretence) -> None:
    assert undone(pretence, 19200, 19200, finish=True) == RateVerdict(Ended.MOVED, {"s1": 19200, "s2": 19200})
    assert pretence.writes == []


def test_and_undone_where_it_did_not_reach_all(pretence: Pretence) -> None:
    verdict = undone(pretence, 19200, 9600, 19200, finish=True)
    assert verdict == RateVerdict(Ended.ROLLED_BACK, {"s1": 9600, "s2": 9600, "s3": 9600})


def test_one_that_is_missing_is_told_once_and_waited_for_however_long_it_takes(pretence: Pretence) -> None:
    sensor = pretence.sensor(2, baudrate=19200, silent=True)
    pretence.later.append((300.0, lambda: setattr(sensor, "silent", False)))
    sensors = [Sensor("s2", 2, pretence.asking())]
    verdict = pretence.carry_out(undo(sensors, *UP, longest_pause=15.0, finish=False))
    assert verdict == RateVerdict(Ended.ROLLED_BACK, {"s2": 9600})
    assert all(isinstance(each, RateVerdict) and each.ended is Ended.UNVERIFIED for each in pretence.aside)
    assert {each.names for each in pretence.aside if isinstance(each, RateVerdict)} == {("s2",)}


def test_each_sensor_that_comes_up_at_the_new_rate_is_told_and_the_end_is_when_all_have(pretence: Pretence) -> None:
    for slave in (1, 2):
        pretence.sensor(slave)
    sensors = [Sensor(f"s{slave}", slave, pretence.asking()) for slave in (1, 2)]
    for at, sensor in zip((30.0, 100.0), pretence.sensors, strict=True):
        pretence.later.append((at, partial(setattr, sensor, "baudrate", 19200)))
    verdict = pretence.carry_out(await_power(sensors, *UP, longest_pause=4.0))
    assert verdict == RateVerdict(Ended.MOVED, {"s1": 19200, "s2": 19200})
    assert pretence.aside == [CameUp("s1"), CameUp("s2")]
    assert pretence.clock.now < 100.0 + 6.0
    assert pretence.writes == []


def test_one_that_answers_at_both_rates_is_two_and_is_awaited_until_the_other_has_come_up(pretence: Pretence) -> None:
    pretence.sensor(1, baudrate=19200)
    stays = pretence.sensor(1)
    pretence.later.append((30.0, partial(setattr, stays, "baudrate", 19200)))
    sensors = [Sensor("s1", 1, pretence.asking())]
    verdict = pretence.carry_out(await_power(sensors, *UP, longest_pause=4.0))
    assert verdict == RateVerdict(Ended.MOVED, {"s1": 19200})
    assert pretence.aside == [Twins("s1"), CameUp("s1")]
    assert pretence.clock.now >= 30.0
