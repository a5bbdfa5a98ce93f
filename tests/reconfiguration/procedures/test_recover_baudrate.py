"""Sensors of a change of rate that was cut short, or that wait for their power cycle."""

from __future__ import annotations

from functools import partial
from math import inf

import pytest

from lfs10d.reconfiguration.procedures.baudrate import BaudrateEnding, BaudrateReport, RateSensor
from lfs10d.reconfiguration.procedures.recover_baudrate import (
    CameUp,
    StillLost,
    Twins,
    await_lost,
    await_power,
    look_back,
    put_back,
)
from tests.support.sensors import Pretence

UP = (9600, 19200)


def sensors_of(pretence: Pretence, *slaves: int) -> list[RateSensor]:
    return [RateSensor(f"s{slave}", slave, pretence.query()) for slave in slaves]


def put(
    pretence: Pretence, *slaves: int, own: int = 9600, where: dict[str, int | None] | None = None
) -> BaudrateReport:
    """Look for the sensors, and put back what was found."""
    where = {} if where is None else where
    sensors = sensors_of(pretence, *slaves)
    pretence.carry_out(look_back(sensors, *UP, where, own=own))
    return pretence.carry_out(put_back(sensors, *UP, where))


def awaited(
    pretence: Pretence, *slaves: int, give_up_at: float = inf, own: int = 9600, at: int | None = None
) -> list[str]:
    where = {f"s{slave}": at for slave in slaves}
    steps = await_lost(
        sensors_of(pretence, *slaves), *UP, where, own=own, pause=1.0, longest_pause=15.0, give_up_at=give_up_at
    )  # fmt: skip
    return [sensor.name for sensor in pretence.carry_out(steps)]


@pytest.mark.parametrize("own", UP)
def test_a_look_finds_out_where_each_is_and_writes_to_nobody_who_is_right(pretence: Pretence, own: int) -> None:
    for slave, rate in enumerate((19200, 9600), 1):
        pretence.sensor(slave, baudrate=rate)
    where: dict[str, int | None] = {}
    pretence.carry_out(look_back(sensors_of(pretence, 1, 2, 3), *UP, where, own=own))
    assert where == {"s1": 19200, "s2": 9600, "s3": None}
    assert pretence.writes == []


def test_one_that_has_stored_the_other_rate_is_written_back_before_anybody_is_waited_for(pretence: Pretence) -> None:
    """A lost one first, one at the other rate that takes a verification of its own, and one that has stored it."""
    pretence.sensor(1, silent=True)
    pretence.sensor(2, baudrate=19200)
    pretence.sensor(3, manner="stores", stored={4: 2})
    report = put(pretence, 1, 2, 3)
    assert report == BaudrateReport(BaudrateEnding.UNVERIFIED, {"s1": None, "s2": 9600, "s3": 9600}, ("s1",))
    assert (pretence.writes[0].slave, pretence.writes[0].value) == (3, 1)
    asked = [(ask.request.slave, ask.baudrate) for ask in pretence.asked]
    assert asked[:2] == [(1, 9600), (1, 19200)], "once at each rate, the line's own first"
    assert asked.count((1, 9600)) == 1


def test_a_verdict_speaks_of_those_that_were_found_before_too(pretence: Pretence) -> None:
    pretence.sensor(2)
    assert put(pretence, 2, where={"s1": None, "s2": None}).names == ("s1",)
    assert put(pretence, 2, where={"s1": 9600, "s2": None}).ended is BaudrateEnding.ROLLED_BACK


def test_a_lost_one_is_waited_for_however_long_it_takes_and_nothing_is_written(pretence: Pretence) -> None:
    sensor = pretence.sensor(2, baudrate=19200, silent=True)
    pretence.later.append((300.0, lambda: setattr(sensor, "silent", False)))
    assert awaited(pretence, 1, 2, give_up_at=60.0) == ["s2"]
    assert pretence.writes == []
    assert pretence.awaited == [StillLost()]
    assert 300.0 < pretence.clock.now < 320.0


@pytest.mark.parametrize("own", [9600, 19200])
def test_a_lost_one_is_asked_at_the_line_s_own_rate_first(pretence: Pretence, own: int) -> None:
    pretence.sensor(1, silent=True)
    sensor = pretence.sensor(2, silent=True)
    pretence.later.append((3.0, lambda: setattr(sensor, "silent", False)))
    awaited(pretence, 1, 2, own=own)
    assert pretence.asked[0].baudrate == own
    assert pretence.asked[1].baudrate != own


def test_a_slow_one_is_found_for_now_and_then_it_is_waited_for_long_at_each_rate_in_turn(pretence: Pretence) -> None:
    sensor = pretence.sensor(2, silent=True)
    pretence.later.append((150.0, lambda: setattr(sensor, "silent", False)))
    awaited(pretence, 2)
    waits = {rate: [ask.timeout for ask in pretence.asked if ask.baudrate == rate] for rate in (9600, 19200)}
    assert waits[9600][:8] == [0.2, 0.2, 0.2, 1.0, 0.2, 0.2, 0.2, 0.2]
    assert waits[19200][:8] == [0.2, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2, 1.0]


def test_one_that_is_put_back_while_another_of_its_id_stays_is_two_and_counts_as_not_back(pretence: Pretence) -> None:
    pretence.sensor(1, baudrate=19200)
    stays = pretence.sensor(1, baudrate=19200, manner="stores")
    where: dict[str, int | None] = {"s1": 19200}
    report = pretence.carry_out(put_back(sensors_of(pretence, 1), *UP, where))
    assert report == BaudrateReport(BaudrateEnding.UNVERIFIED, {"s1": 19200}, ("s1",))
    assert pretence.awaited == [Twins("s1")]

    def power_up() -> None:
        stays.baudrate, stays.stored = 9600, {}

    pretence.later.append((100.0, power_up))
    begun = len(pretence.writes)
    assert awaited(pretence, 1, at=19200) == ["s1"]
    assert pretence.clock.now > 100.0, "the one that is back does not pass for the other"
    assert len(pretence.writes) == begun


def test_one_that_waits_for_its_power_cycle_to_come_back_is_waited_for_and_not_written_again(
    pretence: Pretence,
) -> None:
    sensor = pretence.sensor(2, baudrate=19200, stored={4: 1})

    def power_up() -> None:
        sensor.baudrate, sensor.stored = 9600, {}

    pretence.later.append((100.0, power_up))
    assert awaited(pretence, 2) == ["s2"]
    assert pretence.writes == []
    assert pretence.clock.now > 100.0


def test_each_sensor_that_comes_up_at_the_new_rate_is_told_and_the_end_is_when_all_have(pretence: Pretence) -> None:
    for slave in (1, 2):
        pretence.sensor(slave)
    sensors = [RateSensor(f"s{slave}", slave, pretence.query()) for slave in (1, 2)]
    for at, sensor in zip((30.0, 100.0), pretence.sensors, strict=True):
        pretence.later.append((at, partial(setattr, sensor, "baudrate", 19200)))
    report = pretence.carry_out(await_power(sensors, *UP, longest_pause=4.0))
    assert report == BaudrateReport(BaudrateEnding.MOVED, {"s1": 19200, "s2": 19200})
    assert pretence.awaited == [CameUp("s1"), CameUp("s2")]
    assert pretence.clock.now < 100.0 + 6.0
    assert pretence.writes == []


def test_one_that_answers_at_both_rates_is_two_and_is_awaited_until_the_other_has_come_up(pretence: Pretence) -> None:
    pretence.sensor(1, baudrate=19200)
    stays = pretence.sensor(1)
    pretence.later.append((30.0, partial(setattr, stays, "baudrate", 19200)))
    sensors = [RateSensor("s1", 1, pretence.query())]
    report = pretence.carry_out(await_power(sensors, *UP, longest_pause=4.0))
    assert report == BaudrateReport(BaudrateEnding.MOVED, {"s1": 19200})
    assert pretence.awaited == [Twins("s1"), CameUp("s1")]
    assert pretence.clock.now >= 30.0
