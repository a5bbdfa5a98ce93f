"""`line/adopt` on a whole line in virtual time: plug one in, it gets the next free id, the line's rate and a name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from lfs10d.commands import Answer, Call
from lfs10d.forgetful import PowerCutError
from lfs10d.physical.adoption import Newcomer
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format

if TYPE_CHECKING:
    from tests.physical.conftest import Bench, Life


def plugged(bench: Bench, baudrate: int = 9600, slave: int = 1) -> Sensor:
    return bench.line.add(Sensor(slave, format=Format(baudrate)))


def adopted(bench: Bench, life: Life, **wanted: Any) -> Answer:  # noqa: ANN401 - as Newcomer
    return bench.ask(life, life.physical.adopt(Newcomer(**wanted), Call("n1")), within=300.0)


@pytest.mark.parametrize("baudrate", [9600, 19200])
@pytest.mark.parametrize("manner", [None, "at_once", "echo_losing", "slow_flash", "late"])
def test_a_newcomer_gets_the_next_free_id_and_the_lines_rate(bench: Bench, manner: str | None, baudrate: int) -> None:
    life = bench.sensors(2, 4, baudrate=baudrate)
    bench.go(life, 3.0)
    sensor = plugged(bench)
    if manner:
        sensor.ail(manner)
    answer = adopted(bench, life, label="Mast, 10 m")
    assert (answer.status, answer.data) == ("ok", {"device": "slave-3", "slave": 3, "from": 1})
    assert (sensor.slave, sensor.format.baudrate) == (3, baudrate)
    assert not life.physical.open
    slave = life.running.now.slave("slave-3")
    assert slave is not None
    assert (slave.id, slave.label) == (3, "Mast, 10 m")
    sensor.heal()
    before = len(life.readings)
    bench.go(life, 10.0)
    assert len([each for each in life.readings[before:] if each.device == "slave-3" and each.values]) >= 8
    again = plugged(bench)
    assert adopted(bench, life, name="north").data == {"device": "north", "slave": 5, "from": 1}
    assert again.slave == 5
    bench.cut()
    life = bench.begin()
    assert (life.place("slave-3"), life.place("north")) == (3, 5)


def test_an_id_at_which_a_stranger_answers_is_passed_over(bench: Bench) -> None:
    life = bench.sensors(2)
    plugged(bench, slave=3)
    plugged(bench, 19200, slave=4)
    sensor = plugged(bench)
    bench.go(life, 3.0)
    assert adopted(bench, life).data == {"device": "slave-5", "slave": 5, "from": 1}
    assert sensor.slave == 5


@pytest.mark.parametrize(
    ("wanted", "code"),
    [
        ({}, "timeout"),
        ({"to": 2}, "address_in_use"),
        ({"factory": 2}, "address_in_use"),
        ({"name": "s2"}, "invalid_param"),
    ],
)
def test_what_cannot_be_is_rejected(bench: Bench, wanted: dict[str, Any], code: str) -> None:
    life = bench.sensors(2)
    bench.go(life, 3.0)
    answer = adopted(bench, life, **wanted)
    assert (answer.status, answer.code) == ("rejected", code)
    assert not [request for request in bench.line.log if request.body[1:2] == b"\x06"]


def test_two_newcomers_at_once_are_not_touched(bench: Bench) -> None:
    life = bench.sensors(2)
    bench.go(life, 3.0)
    plugged(bench)
    plugged(bench)
    assert adopted(bench, life).code == "duplicate_id"
    assert not [request for request in bench.line.log if request.body[1:2] == b"\x06"]


@pytest.mark.parametrize("baudrate", [9600, 19200])
def test_a_newcomer_that_wants_a_power_cycle_is_polled_after_it(bench: Bench, baudrate: int) -> None:
    life = bench.sensors(2, baudrate=baudrate)
    bench.go(life, 3.0)
    sensor = plugged(bench)
    sensor.ail("power_cycle")
    for _ in range(3):
        if adopted(bench, life).code != "power_cycle_needed":
            break
        sensor.power_cycle()
        bench.go(life, 60.0)
    assert (sensor.slave, sensor.format.baudrate) == (3, baudrate)
    assert life.place("slave-3") == 3
    assert not life.physical.open


@pytest.mark.parametrize("baudrate", [9600, 19200])
def test_wherever_it_dies_the_newcomer_is_polled_or_can_be_adopted_again(bench: Bench, baudrate: int) -> None:
    for turns in [*range(0, 400, 19), *(-steps for steps in range(1, 20))]:
        bench.renew()
        life = bench.sensors(2, baudrate=baudrate)
        bench.go(life, 3.0)
        sensor = plugged(bench)
        task = bench.loop.create_task(life.physical.adopt(Newcomer(), Call("n1")))
        if turns < 0:
            bench.files.steps_left = bench.files.steps - turns
        for _ in range(turns if turns >= 0 else 2000):
            bench.turn(life)
            if task.done():
                break
        assert turns >= 0 or not task.done() or task.exception() is None or isinstance(task.exception(), PowerCutError)
        bench.cut()
        life = bench.begin()
        bench.go(life, 40.0)
        assert not life.physical.open
        if life.running.now.slave("slave-3") is None:
            assert sensor.slave == 1
            assert adopted(bench, life).status == "ok"
        assert (sensor.slave, sensor.format.baudrate, life.place("slave-3")) == (3, baudrate, 3)
