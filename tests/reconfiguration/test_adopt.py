"""`line/adopt` on a whole line in virtual time: plug one in, it gets the next free id, the line's rate and a name."""

from __future__ import annotations

from typing import Any

import pytest

from lfs10d.command import Command
from lfs10d.reconfiguration.adopt_request import AdoptRequest
from lfs10d.simulator.blueprint import Blueprint
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.faulty_sensors import add_fault, power_cycle
from tests.support.lives import Bench
from tests.support.newcomers import adopted, plugged, writes
from tests.support.volatile_disk import PowerCutError

pytestmark = pytest.mark.long(6)


@pytest.mark.parametrize("baudrate", [9600, 19200])
@pytest.mark.parametrize("manner", [None, "at_once", "echo_losing", "slow_flash", "late"])
def test_a_newcomer_gets_the_next_free_id_and_the_lines_rate(bench: Bench, manner: str | None, baudrate: int) -> None:
    life = bench.sensors(2, 4, baudrate=baudrate)
    bench.go(life, 3.0)
    sensor = plugged(bench)
    if manner:
        add_fault(sensor, manner)
    answer = adopted(bench, life, label="Mast, 10 m")
    assert (answer.status, answer.data) == ("ok", {"device": "slave-3", "slave": 3, "from": 1})
    assert (sensor.slave, sensor.format.baudrate) == (3, baudrate)
    assert not life.physical.open
    slave = life.running.now.slave("slave-3")
    assert slave is not None
    assert (slave.id, slave.label) == (3, "Mast, 10 m")
    sensor.faults.clear()
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
    add_fault(sensor, "power_cycle")
    for _ in range(3):
        if adopted(bench, life).code != "power_cycle_needed":
            break
        power_cycle(sensor)
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
        task = bench.loop.create_task(life.physical.adopt(AdoptRequest(), Command("n1")))
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


@pytest.mark.parametrize("slaves", ["[]", "[{id: 3, name: off, enabled: false}]", "[{id: 3, profile: eh600}]"])
@pytest.mark.parametrize("cut", [False, True])
def test_the_first_sensor_of_a_line_is_adopted_as_any_other(bench: Bench, slaves: str, *, cut: bool) -> None:
    bench.sensors(names=False)
    bench.file.write_text(bench.file.read_text().replace("slaves: []", f"slaves: {slaves}"))
    bench.cut()
    life = bench.begin()
    sensor = plugged(bench)
    bench.go(life, 3.0)
    if cut:  # the daemon dies right after the write, and finds the newcomer in its next life
        bench.line.after_each_request(lambda _: None)
        task = bench.loop.create_task(life.physical.adopt(AdoptRequest(), Command("n1")))
        while not writes(bench):
            bench.turn(life)
        bench.cut()
        del task
        life = bench.begin()
        bench.go(life, 40.0)
    else:
        assert adopted(bench, life).data == {"device": "slave-2", "slave": 2, "from": 1}
    assert (sensor.slave, life.place("slave-2"), life.physical.open) == (2, 2, ())


FOREIGN: list[tuple[dict[int, int], str]] = [
    ({0: 3, 1: 225, 2: 0, 3: 7, 4: 9, 5: 700}, "says 700, not 1"),
    ({1: 225, 2: 0, 4: 1, 5: 1}, "wind_speed"),
    ({1: 0x414F, 2: 0xD70A, 4: 9, 5: 1}, "its register 0x0004 says 9"),
    ({1: 0x414F, 2: 0xD70A, 5: 1}, "its register 0x0004 does not answer"),
    ({4: 1, 5: 1}, "it refuses (exception 02) its values"),
    ({0: 87, 2000: 1, 2001: 2}, "it refuses register 0x0005 (exception 02)"),
]


def stranger(bench: Bench, words: dict[int, int], baudrate: int = 9600, slave: int = 1) -> Sensor:
    """Put another device on the line: it has these registers, and any write to them takes."""
    anything = range(1 << 16)
    kind = Blueprint("stranger", (), words, dict.fromkeys(words, anything))
    return bench.line.add(Sensor(slave, blueprint=kind, format=Format(baudrate)))


@pytest.mark.parametrize(("words", "why"), FOREIGN)
@pytest.mark.parametrize("baudrate", [9600, 19200])
def test_nothing_is_written_to_a_device_that_is_not_recognised(
    bench: Bench, words: dict[int, int], why: str, baudrate: int
) -> None:
    life = bench.sensors(2)
    stranger(bench, words, baudrate)
    bench.go(life, 3.0)
    answer = adopted(bench, life)
    assert (answer.status, answer.code) == ("rejected", "not_recognised")
    assert why in answer.message
    assert f"at {baudrate} baud" in answer.message
    assert writes(bench) == []
    assert not life.physical.open


def test_a_newcomer_beside_a_stranger_is_left_alone_whatever_their_rates(bench: Bench) -> None:
    life = bench.sensors(2)
    stranger(bench, {0: 1})
    plugged(bench, 19200)
    bench.go(life, 3.0)
    assert adopted(bench, life).code == "duplicate_id"
    assert writes(bench) == []


@pytest.mark.parametrize("turnaround", [0.009, 0.02, 0.1])
def test_two_newcomers_that_answer_one_after_the_other_are_not_touched(bench: Bench, turnaround: float) -> None:
    life = bench.sensors(2)
    plugged(bench)
    plugged(bench).turnaround = turnaround
    bench.go(life, 3.0)
    assert adopted(bench, life).code == "duplicate_id"
    assert writes(bench) == []
