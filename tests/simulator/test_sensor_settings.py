"""A new id or rate as each kind of sensor takes it, and what a power cycle makes of it."""

from __future__ import annotations

import pytest

from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.faulty_sensors import add_fault, power_cycle
from tests.support.sensor_values import ID, RATE, Maker


def test_a_new_id_is_obeyed_after_an_echo_from_the_old_place(bench: Maker) -> None:
    line = bench(Sensor(1))
    assert line.write(1, ID, 9) == bytes.fromhex("01 06 00 05 00 09")
    assert line.id_of(1) is None
    assert line.id_of(9) == 9


def test_a_new_rate_is_obeyed_after_an_echo_at_the_old_one(bench: Maker) -> None:
    line = bench(Sensor(1))
    assert line.write(1, RATE, 2) is not None
    assert line.read(1) is None
    assert line.line.sensor(1).format == Format(19200)


def test_a_rate_written_anew_changes_nothing(bench: Maker) -> None:
    line = bench(Sensor(1))
    line.write(1, RATE, 1)
    assert line.id_of(1) == 1


def test_one_that_obeys_at_once_echoes_from_the_new_place(bench: Maker) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), "at_once")
    assert line.write(1, ID, 9) == bytes.fromhex("09 06 00 05 00 09")
    assert line.write(9, RATE, 2) is None
    assert line.heard  # the echo, at 19200: noise


def test_power_cycle_needing_ones_read_new_and_answer_at_the_old_place(bench: Maker) -> None:
    line = bench(Sensor(1))
    sensor = line.line.sensor(1)
    add_fault(sensor, "power_cycle")
    line.write(1, ID, 9)
    assert line.id_of(1) == 9
    assert line.id_of(9) is None
    power_cycle(sensor)
    assert line.id_of(9) == 9


def test_one_that_stores_but_ignores_never_obeys(bench: Maker) -> None:
    line = bench(Sensor(1))
    sensor = line.line.sensor(1)
    add_fault(sensor, "stores_but_ignores")
    line.write(1, ID, 9)
    power_cycle(sensor)
    assert line.id_of(1) == 9
    assert line.id_of(9) is None


@pytest.mark.parametrize("reads", ["old", "new"])
@pytest.mark.parametrize("answer", ["echo", "exception"])
def test_the_dip_switch_wins_in_every_variant(bench: Maker, reads: str, answer: str) -> None:
    line = bench(Sensor(1))
    sensor = line.line.sensor(1)
    add_fault(sensor, "dip_locked", answer=answer, reads=reads, code=3)
    echo = bytes.fromhex("01 06 00 05 00 09")
    assert line.write(1, ID, 9) == (echo if answer == "echo" else bytes.fromhex("01 86 03"))
    assert line.id_of(1) == (9 if reads == "new" else 1)
    power_cycle(sensor)
    assert line.id_of(1) == 1
    line.write(1, RATE, 2)
    assert sensor.format.baudrate == 19200  # the switch sets the id only


def test_a_lost_echo_does_not_undo_the_write(bench: Maker) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), "echo_losing")
    assert line.write(1, ID, 9) is None
    assert line.id_of(9) == 9
    assert line.exchange(bytes.fromhex("09 06 00 03 00 01")) == bytes.fromhex("09 86 02")


def test_slow_flash_is_silent_after_the_echo_of_a_change_only(bench: Maker) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), "slow_flash", delay=3.0)
    assert line.write(1, ID, 1) is not None
    assert line.id_of(1) == 1
    assert line.write(1, ID, 9) is not None
    assert line.id_of(9) is None
    line.listen(3.0)
    assert line.id_of(9) == 9


def test_a_scheduled_power_cut_makes_it_obey_what_was_stored(bench: Maker) -> None:
    line = bench(Sensor(1))
    sensor = line.line.sensor(1)
    add_fault(sensor, "power_cycle")
    add_fault(sensor, "power_cut", first=5.0, last=6.0)
    line.write(1, ID, 9)
    line.reach(5.0)
    assert line.id_of(1) is None
    line.reach(6.0)
    assert line.id_of(9) == 9
