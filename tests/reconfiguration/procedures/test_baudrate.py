"""Every sensor to another rate, one after the other, or all of them back."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import pytest

from lfs10d.modbus.request import WriteRegister
from lfs10d.profiles.library import load_profile
from lfs10d.reconfiguration.procedures.baudrate import (
    ROLL_BACK,
    UNTOUCHED,
    BaudrateEnding,
    BaudrateReport,
    RateSensor,
    RateWish,
    WriteRates,
    change_rate,
    restore_rate,
)
from lfs10d.reconfiguration.procedures.readdress import ECHO_READS
from tests.support.sensors import LFS10, Pretence

UP = (9600, 19200)
BARE = """
name: bare
title: No register of the rate
ids: [1, 247]
framings: [rtu]
checksums: [crc]
max_words: 1
values:
  - {name: level, register: 1, type: uint16, unit: "1", source: none}
slave_id: {register: 5, source: none}
"""


def line(pretence: Pretence, *manners: str) -> tuple[RateSensor, ...]:
    """Put sensors of these manners on the line, as `s1`, `s2` ..., and return how they are asked."""
    for slave, manner in enumerate(manners, 1):
        pretence.sensor(slave, manner=manner)
    return tuple(RateSensor(f"s{slave}", slave, pretence.query()) for slave in range(1, len(manners) + 1))


def changed(pretence: Pretence, *manners: str, echo_known: bool = True, **wish: Any) -> BaudrateReport:  # noqa: ANN401  # passed on
    sensors = line(pretence, *manners)
    return pretence.carry_out(change_rate(RateWish(sensors, *UP, **wish), lambda: echo_known))


# -- the whole


def test_sensors_that_obey_are_moved_one_after_the_other(pretence: Pretence) -> None:
    report = changed(pretence, "obeys", "obeys")
    assert report == BaudrateReport(BaudrateEnding.MOVED, {"s1": 19200, "s2": 19200})
    assert pretence.writes == [WriteRegister(1, 4, 2), WriteRegister(2, 4, 2)]
    assert pretence.awaited == [WriteRates()]


def test_sensors_that_know_function_16_only_are_written_by_it(pretence: Pretence) -> None:
    profile = LFS10.model_copy(update={"write_function": 16})
    pretence.sensor(1)
    pretence.sensor(2, manner="stores")
    sensors = tuple(RateSensor(f"s{slave}", slave, pretence.query(profile)) for slave in (1, 2))
    assert pretence.carry_out(change_rate(RateWish(sensors, *UP), lambda: True)).ended is not BaudrateEnding.MOVED
    assert {write.function for write in pretence.writes} == {16}
    assert {(write.slave, write.value) for write in pretence.writes} >= {(1, 2), (2, 2), (1, 1)}, "and moved back by it"


def test_a_line_without_sensors_is_moved_at_once(pretence: Pretence) -> None:
    assert changed(pretence, echo_known=False) == BaudrateReport(BaudrateEnding.MOVED)


def test_a_dry_run_looks_and_writes_nothing(pretence: Pretence) -> None:
    assert changed(pretence, "obeys", dry_run=True) == BaudrateReport(BaudrateEnding.FREE)
    assert pretence.writes == pretence.awaited == []


def test_nothing_is_written_unless_every_sensor_answers(pretence: Pretence) -> None:
    sensors = line(pretence, "obeys", "obeys", "obeys")
    pretence.sensors[1].silent = pretence.sensors[2].silent = True
    report = pretence.carry_out(change_rate(RateWish(sensors, *UP), lambda: True))
    assert report == BaudrateReport(BaudrateEnding.ABSENT, names=("s2", "s3"))
    assert pretence.writes == []


def test_nor_where_it_is_not_known_how_the_adapter_echoes(pretence: Pretence) -> None:
    assert changed(pretence, "obeys", "obeys", echo_known=False) == BaudrateReport(BaudrateEnding.DEAF)
    assert len(pretence.asked) == 2 + ECHO_READS


def test_reads_that_teach_the_echo_are_enough(pretence: Pretence) -> None:
    sensors = line(pretence, "obeys")
    steps = change_rate(RateWish(sensors, *UP), lambda: len(pretence.asked) >= 4)
    assert pretence.carry_out(steps).ended is BaudrateEnding.MOVED


def test_nor_where_the_intent_cannot_be_kept(pretence: Pretence) -> None:
    pretence.answer = "the disk is full"
    report = changed(pretence, "obeys")
    assert report == BaudrateReport(BaudrateEnding.UNWRITTEN, why="the disk is full")
    assert report.ended in UNTOUCHED
    assert pretence.writes == []


def test_a_port_lost_before_the_first_write_is_told_as_that(pretence: Pretence) -> None:
    pretence.lost_at = 0
    assert changed(pretence, "obeys") == BaudrateReport(BaudrateEnding.LOST_BEFORE)


def test_a_port_lost_after_it_leaves_every_place_unknown(pretence: Pretence) -> None:
    pretence.lost_at = 3
    assert changed(pretence, "obeys", "obeys") == BaudrateReport(BaudrateEnding.UNVERIFIED, {"s1": None, "s2": None})
    assert len(pretence.writes) == 1


# -- the canary


@pytest.mark.parametrize(
    ("manner", "ended", "exception", "writes"),
    [
        ("ignores", BaudrateEnding.CANARY, None, [2]),
        ("stores", BaudrateEnding.CANARY, None, [2, 1]),
        ("refuses", BaudrateEnding.REFUSED, 3, [2]),
    ],
)
def test_a_first_sensor_that_does_not_move_is_put_back_and_nobody_else_is_touched(
    pretence: Pretence, manner: str, ended: BaudrateEnding, exception: int | None, writes: list[int]
) -> None:
    report = changed(pretence, manner, "obeys")
    assert report == BaudrateReport(ended, {"s1": 9600, "s2": 9600}, ("s1",), exception)
    assert pretence.writes == [WriteRegister(1, 4, code) for code in writes]


def test_a_first_sensor_that_cannot_be_put_back_is_told_as_unverified(pretence: Pretence) -> None:
    sensors = line(pretence, "stores")
    stubborn = pretence.sensors[0]
    pretence.later.append((4.0, lambda: setattr(stubborn, "manner", "ignores")))
    report = pretence.carry_out(change_rate(RateWish(sensors, *UP), lambda: True))
    assert report == BaudrateReport(BaudrateEnding.UNVERIFIED, {"s1": None}, ("s1",))


# -- back


def test_if_a_later_one_stays_those_moved_are_moved_back(pretence: Pretence) -> None:
    report = changed(pretence, "obeys", "ignores", "obeys")
    assert report == BaudrateReport(BaudrateEnding.ROLLED_BACK, {"s1": 9600, "s2": 9600, "s3": 9600})
    assert [write.slave for write in pretence.writes] == [1, 2, 1, 1], "and once more, for a second sensor"


def test_if_the_first_is_found_nowhere_it_is_looked_for_for_a_minute(pretence: Pretence) -> None:
    report = changed(pretence, "vanishes", "obeys")
    assert report == BaudrateReport(BaudrateEnding.UNVERIFIED, {"s1": None, "s2": 9600}, ("s1",))
    assert ROLL_BACK < pretence.clock.now < ROLL_BACK + 20.0


def test_one_that_comes_back_within_that_minute_is_moved_back_too(pretence: Pretence) -> None:
    sensors = line(pretence, "obeys", "vanishes")

    def back() -> None:
        pretence.sensors[1].silent = False
        pretence.sensors[1].manner = "obeys"

    pretence.later.append((20.0, back))
    report = pretence.carry_out(change_rate(RateWish(sensors, *UP), lambda: True))
    assert report == BaudrateReport(BaudrateEnding.ROLLED_BACK, {"s1": 9600, "s2": 9600})


# -- with a power cycle


def test_with_a_power_cycle_all_are_written_and_those_that_wait_are_told(pretence: Pretence) -> None:
    report = changed(pretence, "stores", "obeys", "stores", power_cycle=True)
    assert report == BaudrateReport(BaudrateEnding.PENDING, {"s1": 9600, "s2": 19200, "s3": 9600}, ("s1", "s3"))
    assert len(pretence.writes) == 3


def test_with_a_power_cycle_those_that_obey_at_once_are_moved(pretence: Pretence) -> None:
    assert changed(pretence, "obeys", power_cycle=True) == BaudrateReport(BaudrateEnding.MOVED, {"s1": 19200})


@pytest.mark.parametrize("manner", ["ignores", "refuses", "refuses_and_stores"])
def test_with_a_power_cycle_one_that_does_not_take_the_rate_has_all_put_back(pretence: Pretence, manner: str) -> None:
    report = changed(pretence, "stores", manner, "stores", power_cycle=True)
    assert report == BaudrateReport(BaudrateEnding.ROLLED_BACK, {"s1": 9600, "s2": 9600, "s3": 9600})
    assert 3 not in {write.slave for write in pretence.writes}


# -- one sensor


@pytest.mark.parametrize(
    ("facts", "at", "writes"),
    [
        ({}, 9600, []),
        ({"baudrate": 19200}, 9600, [1, 1]),
        ({"baudrate": 19200, "manner": "ignores"}, 19200, [1]),
        ({"stored": {4: 2}}, 9600, [1]),
        ({"stored": {4: 2}, "manner": "ignores"}, None, [1]),
        ({"silent": True}, None, []),
    ],
)
def test_a_sensor_is_brought_to_a_rate_and_its_register_too(
    pretence: Pretence, facts: dict[str, Any], at: int | None, writes: list[int]
) -> None:
    pretence.sensor(1, **facts)
    sensor = RateSensor("s1", 1, pretence.query())
    assert pretence.carry_out(restore_rate(sensor, 9600, 19200)) == at
    assert [write.value for write in pretence.writes] == writes


def test_a_sensor_whose_profile_has_no_register_of_the_rate_has_no_code(pretence: Pretence, tmp_path: Path) -> None:
    (tmp_path / "bare.yaml").write_text(BARE)
    bare = RateSensor("x", 1, pretence.query(load_profile("bare.yaml", relative_to=tmp_path)))
    assert (bare.register, bare.code(9600)) == (-1, -1)
    known = RateSensor("x", 1, pretence.query())
    assert (known.register, known.code(9600), known.code(19200)) == (4, 1, 2)


# -- two sensors of one slave id


def test_one_that_answers_at_both_rates_since_the_write_is_two_and_all_are_moved_back(pretence: Pretence) -> None:
    sensors = line(pretence, "obeys", "obeys")
    pretence.sensor(2, manner="stores")
    report = pretence.carry_out(change_rate(RateWish(sensors, *UP), lambda: True))
    assert report == BaudrateReport(BaudrateEnding.TWINS, {"s1": 9600, "s2": 9600}, ("s2",))
    assert [sensor.baudrate for sensor in pretence.sensors] == [9600] * 3


def test_the_one_of_two_that_stayed_forgets_the_rate_it_stored(pretence: Pretence) -> None:
    sensors = line(pretence, "stores")
    pretence.sensor(1)
    report = pretence.carry_out(change_rate(RateWish(sensors, *UP), lambda: True))
    assert report.ended is BaudrateEnding.TWINS
    assert [sensor.stored.get(4, 1) for sensor in pretence.sensors] == [1, 1]


def test_so_with_a_power_cycle(pretence: Pretence) -> None:
    sensors = line(pretence, "stores")
    pretence.sensor(1)
    report = pretence.carry_out(change_rate(RateWish(sensors, *UP, power_cycle=True), lambda: True))
    assert report == BaudrateReport(BaudrateEnding.TWINS, {"s1": 9600}, ("s1",))
    assert [(sensor.baudrate, sensor.stored.get(4, 1)) for sensor in pretence.sensors] == [(9600, 1)] * 2


def test_one_that_was_deaf_while_its_twin_was_brought_back_is_looked_for_once_more(pretence: Pretence) -> None:
    sensors = line(pretence, "obeys", "ignores")
    deaf = pretence.sensor(1, baudrate=19200, silent=True)
    pretence.later.append((12.0, partial(vars(deaf).update, silent=False)))
    report = pretence.carry_out(change_rate(RateWish(sensors, *UP), lambda: True))
    assert report == BaudrateReport(BaudrateEnding.ROLLED_BACK, {"s1": 9600, "s2": 9600})
    assert [sensor.baudrate for sensor in pretence.sensors] == [9600] * 3


def test_a_first_sensor_that_stays_has_the_others_forget_what_they_stored_before(pretence: Pretence) -> None:
    sensors = line(pretence, "stores", "stores", "obeys")
    pretence.sensors[1].stored[4] = 2
    report = pretence.carry_out(change_rate(RateWish(sensors, *UP, stored=frozenset({"s1", "s2"})), lambda: True))
    assert report == BaudrateReport(BaudrateEnding.CANARY, dict.fromkeys(("s1", "s2", "s3"), 9600), ("s1",))
    assert [sensor.stored.get(4, 1) for sensor in pretence.sensors] == [1, 1, 1]
    assert 3 not in {write.slave for write in pretence.writes}


def test_one_of_them_that_cannot_be_made_to_forget_is_told(pretence: Pretence) -> None:
    sensors = line(pretence, "stores", "ignores")
    pretence.sensors[1].stored[4] = 2
    report = pretence.carry_out(change_rate(RateWish(sensors, *UP, stored=frozenset({"s2"})), lambda: True))
    assert (report.ended, report.names) == (BaudrateEnding.UNVERIFIED, ("s2",))
