"""`device/readdress` on a whole line in virtual time: every way a sensor can take it."""

from __future__ import annotations

from typing import Any

import pytest

from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wind import Wind
from tests.support.faulty_sensors import add_fault, power_cycle
from tests.support.lives import Bench


def calm(bench: Bench) -> None:
    """Let the sensor 3 measure no wind at all."""
    bench.line.sensor(3).source = lambda _: 0.0


def writes(bench: Bench) -> list[bytes]:
    return [request.body for request in bench.line.log if request.body[1:2] == b"\x06"]


@pytest.mark.parametrize("echo", [False, True])
@pytest.mark.parametrize("manner", [None, "at_once", "echo_losing", "slow_flash", "late"])
def test_a_sensor_that_obeys_is_moved_and_polled_at_its_new_id(bench: Bench, manner: str | None, echo: bool) -> None:  # noqa: FBT001 - the test's parameter
    life = bench.sensors(3, 4, echo=echo)
    bench.go(life, 5.0)
    if manner:
        add_fault(bench.line.sensor(3), manner)
    answer = bench.readdress(life, "s3", 9)
    assert (answer.status, answer.code, answer.data) == ("ok", None, {"device": "s3", "from": 3, "to": 9})
    assert {sensor.slave for sensor in bench.line.sensors} == {9, 4}
    assert life.place("s3") == 9
    assert life.told("readdressed") == [{"device": "s3", "from": 3, "to": 9}]
    assert not life.physical.reserved()
    bench.line.sensor(9).faults.clear()
    before = len(life.readings)
    bench.go(life, 10.0)
    after = [reading for reading in life.readings[before:] if reading.device == "s3"]
    assert len([reading for reading in after if reading.values]) >= 8
    bench.cut()
    assert bench.begin().place("s3") == 9


@pytest.mark.parametrize(
    ("sensor_fault", "particulars", "code"),
    [
        ("dip_locked", {"answer": "echo", "reads": "old"}, "dip_switch"),
        ("dip_locked", {"answer": "echo", "reads": "new"}, "power_cycle_needed"),
        ("dip_locked", {"answer": "exception", "reads": "old", "code": 3}, "refused"),
        ("dip_locked", {"answer": "exception", "reads": "new", "code": 3}, "refused"),
        ("stores_but_ignores", {}, "power_cycle_needed"),
        ("power_cycle", {}, "power_cycle_needed"),
    ],
)
def test_one_that_does_not_obey_stays_and_the_answer_says_why(
    bench: Bench, sensor_fault: str, particulars: dict[str, Any], code: str
) -> None:
    life = bench.sensors(3, 4)
    add_fault(bench.line.sensor(3), sensor_fault, **particulars)
    bench.go(life, 5.0)
    answer = bench.readdress(life, "s3", 9)
    assert (answer.status, answer.code) == ("failed", code)
    error = answer.error()
    assert error is not None
    assert error.get("exception_code") == particulars.get("code")
    assert life.place("s3") == 3
    reads_new = bench.line.sensor(3).words[5] == 9
    assert set(life.physical.reserved()) == ({3, 9} if reads_new else set())
    before = len(life.readings)
    bench.go(life, 10.0)
    assert len([r for r in life.readings[before:] if r.device == "s3" and r.values]) >= 8


@pytest.mark.parametrize("manner", ["power_cycle", "stores_but_ignores"])
def test_two_sensors_that_part_are_told_and_do_not_meet_again_at_a_power_cycle(bench: Bench, manner: str) -> None:
    life = bench.sensors(3, 4)
    calm(bench)  # two that answer bit-identically cannot be told apart before
    twin = bench.line.add(Sensor(3, source=lambda _: 0.0))
    add_fault(twin, manner)
    bench.go(life, 3.0)
    answer = bench.readdress(life, "s3", 9)
    assert (answer.status, answer.code) == ("failed", "duplicate_id")
    assert life.told("duplicate_id") == [{"device": "s3", "slave": 9, "from": 3}]
    twin.faults.clear()
    for sensor in bench.line.sensors:
        power_cycle(sensor)
    bench.go(life, 30.0)
    assert sorted(sensor.slave for sensor in bench.line.sensors) == [3, 4, 9]
    assert not life.physical.open


@pytest.mark.parametrize("dry_run", [False, True])
@pytest.mark.parametrize("turnaround", [0.005, 0.0055, 0.009, 0.0145, 0.02, 0.04, 0.1, 0.3])
def test_of_two_sensors_of_one_id_neither_is_moved(bench: Bench, turnaround: float, *, dry_run: bool) -> None:
    life = bench.sensors(3, 4)
    twin = bench.line.add(Sensor(3, turnaround=turnaround))
    bench.go(life, 3.0)
    answer = bench.readdress(life, "s3", 9, dry_run=dry_run)
    assert (answer.status, answer.code) == ("rejected", "duplicate_id")
    assert writes(bench) == []
    assert (twin.slave, life.place("s3"), life.physical.open) == (3, 3, ())
    assert life.told("duplicate_id") == [{"device": "s3", "slave": 3, "from": 3}]


def test_two_whose_values_take_turns_are_not_moved(bench: Bench) -> None:
    life = bench.sensors(3, 4)
    turns = iter(range(10_000))
    bench.line.sensor(3).source = lambda _: 3.0 + 9.5 * (next(turns) % 2)
    bench.go(life, 3.0)
    assert bench.readdress(life, "s3", 9).code == "duplicate_id"
    assert writes(bench) == []


@pytest.mark.parametrize("seed", range(5))
def test_a_sensor_in_gusty_wind_is_one(bench: Bench, seed: int) -> None:
    life = bench.sensors(3, 4)
    bench.line.sensor(3).source = Wind(seed, mean=20.0)
    bench.go(life, 3.0)
    assert bench.readdress(life, "s3", 9).status == "ok"
