"""A sensor that was written to is followed until it is found at one of its two places."""

from __future__ import annotations

from functools import partial

import pytest

from lfs10d.modbus.request import WriteRegister
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.follow import follow
from lfs10d.reconfiguration.procedures.readdress import ReaddressEnding, ReaddressReport
from tests.support.sensors import Pretence

OLD, NEW = Endpoint(slave=3, baudrate=9600), Endpoint(slave=9, baudrate=9600)
BEFORE = Endpoint(slave=3, baudrate=19200)


def test_a_sensor_at_its_new_place_is_found_at_the_first_look(pretence: Pretence) -> None:
    pretence.sensor(9)
    report = pretence.carry_out(follow(OLD, NEW, pretence.query(), longest_pause=15.0))
    assert (report.ending, report.register) == (ReaddressEnding.MOVED, 9)
    assert pretence.awaited == []


def test_one_that_stays_and_says_its_old_id_is_found_too(pretence: Pretence) -> None:
    pretence.sensor(3)
    assert pretence.carry_out(follow(OLD, NEW, pretence.query(), longest_pause=15.0)).ending is ReaddressEnding.LOCKED


def test_one_that_comes_up_later_is_told_as_lost_first_and_then_found(pretence: Pretence) -> None:
    pretence.later.append((30.0, lambda: pretence.sensor(9)))
    report = pretence.carry_out(follow(OLD, NEW, pretence.query(), longest_pause=4.0))
    assert report.ending is ReaddressEnding.MOVED
    assert [each.ending for each in pretence.awaited if isinstance(each, ReaddressReport)] == [ReaddressEnding.NOWHERE]
    assert pretence.clock.now < 30.0 + 10.0


def test_one_that_waits_for_its_power_cycle_is_followed_until_it_obeys(pretence: Pretence) -> None:
    sensor = pretence.sensor(3, stored={5: 9})

    def cycle() -> None:
        sensor.slave = 9
        sensor.stored.clear()

    pretence.later.append((40.0, cycle))
    report = pretence.carry_out(follow(OLD, NEW, pretence.query(), longest_pause=4.0))
    assert report.ending is ReaddressEnding.MOVED
    assert [each.ending for each in pretence.awaited if isinstance(each, ReaddressReport)] == [ReaddressEnding.PENDING]


def test_one_whose_register_goes_back_stays(pretence: Pretence) -> None:
    sensor = pretence.sensor(3, stored={5: 9})
    pretence.later.append((40.0, sensor.stored.clear))
    assert pretence.carry_out(follow(OLD, NEW, pretence.query(), longest_pause=4.0)).ending is ReaddressEnding.LOCKED


def test_garbage_at_the_new_place_has_it_looked_at_in_full_and_told(pretence: Pretence) -> None:
    pretence.later.append((30.0, lambda: pretence.noise.add((9, 9600))))
    pretence.later += [(60.0, pretence.noise.clear), (60.0, lambda: pretence.sensor(9))]
    assert pretence.carry_out(follow(OLD, NEW, pretence.query(), longest_pause=4.0)).ending is ReaddressEnding.MOVED
    endings = {each.ending for each in pretence.awaited if isinstance(each, ReaddressReport)}
    assert endings == {ReaddressEnding.NOWHERE, ReaddressEnding.GARBAGE}


@pytest.mark.parametrize("appears", [0.0, 30.0])
def test_a_sensor_that_never_left_the_place_before_is_found_there(pretence: Pretence, appears: float) -> None:
    pretence.later.append((appears, lambda: pretence.sensor(3, baudrate=19200)))
    report = pretence.carry_out(follow(OLD, NEW, pretence.query(), longest_pause=4.0, before=BEFORE))
    assert report == ReaddressReport(ReaddressEnding.LOCKED, 3)


def test_one_that_has_taken_the_new_id_at_the_place_before_is_not_at_its_end(pretence: Pretence) -> None:
    sensor = pretence.sensor(3, baudrate=19200, stored={5: 9})
    pretence.later.append((30.0, sensor.stored.clear))
    report = pretence.carry_out(follow(OLD, NEW, pretence.query(), longest_pause=4.0, before=BEFORE))
    assert report == ReaddressReport(ReaddressEnding.LOCKED, 3)
    assert pretence.clock.now >= 30.0


def test_the_longest_pause_holds_from_the_first(pretence: Pretence) -> None:
    pretence.later.append((20.0, lambda: pretence.sensor(9)))
    assert pretence.carry_out(follow(OLD, NEW, pretence.query(), longest_pause=0.1)).ending is ReaddressEnding.MOVED
    assert pretence.clock.now < 20.0 + 4.0


def test_a_newcomer_at_its_new_place_is_found_though_the_next_one_is_at_the_factorys_id(pretence: Pretence) -> None:
    pretence.sensor(3)
    pretence.sensor(9)
    follower = follow(OLD, NEW, pretence.query(), longest_pause=4.0, newcomer=True)
    assert pretence.carry_out(follower) == ReaddressReport(ReaddressEnding.MOVED, 9)


def test_one_at_the_old_place_that_has_stored_the_id_of_the_other_gets_its_own_back(pretence: Pretence) -> None:
    other = pretence.sensor(3, stored={5: 9})
    pretence.later += [(30.0, partial(vars(other).update, silent=True))]
    pretence.sensor(9)
    assert pretence.carry_out(follow(OLD, NEW, pretence.query(), longest_pause=4.0)).ending is ReaddressEnding.MOVED
    assert pretence.writes == [WriteRegister(3, 5, 3)]
    assert not other.stored
    assert {each.ending for each in pretence.awaited if isinstance(each, ReaddressReport)} == {ReaddressEnding.BOTH}


def test_a_newcomer_beside_one_that_keeps_its_id_stored_is_not_found(pretence: Pretence) -> None:
    other = pretence.sensor(3, stored={5: 9}, manner="ignores")
    pretence.sensor(9)
    pretence.later.append((30.0, other.stored.clear))
    follower = follow(OLD, NEW, pretence.query(), longest_pause=4.0, newcomer=True)
    assert pretence.carry_out(follower).ending is ReaddressEnding.MOVED
    assert next(each.ending for each in pretence.awaited if isinstance(each, ReaddressReport)) is ReaddressEnding.BOTH
    assert pretence.clock.now >= 30.0


def test_a_newcomer_that_came_to_the_lines_rate_is_not_taken_for_one_at_its_place_before(pretence: Pretence) -> None:
    sensor = pretence.sensor(3, stored={5: 9})
    pretence.sensor(3, baudrate=19200)

    def cycle() -> None:
        sensor.slave = 9
        sensor.stored.clear()

    pretence.later.append((30.0, cycle))
    report = pretence.carry_out(follow(OLD, NEW, pretence.query(), longest_pause=4.0, before=BEFORE, newcomer=True))
    assert report == ReaddressReport(ReaddressEnding.MOVED, 9)
