"""`line/adopt` on a whole line in virtual time: plug one in, it gets the next free id, the line's rate and a name."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from lfs10d.command import Command, Result
from lfs10d.profiles.library import parse_profile
from lfs10d.reconfiguration.adopt_request import AdoptRequest
from lfs10d.simulator.registers import Blueprint, blueprint_of
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.lives import Bench, Life
from tests.support.volatile_disk import PowerCutError

pytestmark = pytest.mark.long


def plugged(bench: Bench, baudrate: int = 9600, slave: int = 1) -> Sensor:
    return bench.line.add(Sensor(slave, format=Format(baudrate)))


RENKE = """\
name: renke-fxjt
title: Renke wind vane
ids: [1, 254]
values:
  - {name: wind_direction, register: 0x0001, type: uint16, unit: "1", range: [0, 360], device_class: wind_direction}
  - {name: sector, register: 0x0000, type: uint16, unit: "1", range: [0, 7]}
slave_id: {register: 0x07D0}
baudrate: {register: 0x07D1, codes: CODES}
factory: {id: 1, baudrate: 4800}
"""
CODES = "{2400: 0, 4800: 1, 9600: 2}"
WITHOUT_4800 = "{9600: 2, 19200: 3}"


def renke(bench: Bench, codes: str = CODES, baudrate: int = 4800) -> Sensor:
    """Put the profile beside the configuration and plug such a vane in; it holds the rates of `CODES` and 19200."""
    file = bench.file.with_name("renke.yaml")
    file.write_text(RENKE.replace("CODES", codes))
    known = blueprint_of(parse_profile(RENKE.replace("CODES", "{2400: 0, 4800: 1, 9600: 2, 19200: 3}"), "renke.yaml"))
    vane = Sensor(1, blueprint=known, format=Format(baudrate), source=lambda _: 5.0)
    return bench.line.add(vane)


def writes(bench: Bench) -> list[bytes]:
    return [request.body for request in bench.line.log if request.body[1:2] == b"\x06"]


def adopted(bench: Bench, life: Life, **wanted: Any) -> Result:  # noqa: ANN401 - as Newcomer
    return bench.ask(life, life.physical.adopt(AdoptRequest(**wanted), Command("n1")), within=300.0)


@pytest.mark.parametrize("baudrate", [9600, 19200])
@pytest.mark.parametrize("manner", [None, "at_once", "echo_losing", "slow_flash", "late"])
def test_a_newcomer_gets_the_next_free_id_and_the_lines_rate(bench: Bench, manner: str | None, baudrate: int) -> None:
    life = bench.sensors(2, 4, baudrate=baudrate)
    bench.go(life, 3.0)
    sensor = plugged(bench)
    if manner:
        sensor.add_fault(manner)
    answer = adopted(bench, life, label="Mast, 10 m")
    assert (answer.status, answer.data) == ("ok", {"device": "slave-3", "slave": 3, "from": 1})
    assert (sensor.slave, sensor.format.baudrate) == (3, baudrate)
    assert not life.physical.open
    slave = life.running.now.slave("slave-3")
    assert slave is not None
    assert (slave.id, slave.label) == (3, "Mast, 10 m")
    sensor.clear_faults()
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
    sensor.add_fault("power_cycle")
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


@pytest.mark.parametrize(("codes", "line"), [(CODES, 9600), (WITHOUT_4800, 9600), (WITHOUT_4800, 19200), (CODES, 4800)])
@pytest.mark.parametrize("manner", [None, "at_once"])
def test_one_of_another_profile_is_adopted_at_its_factorys_rate(
    bench: Bench, codes: str, line: int, manner: str | None
) -> None:
    life = bench.sensors(names=False, baudrate=line)
    vane = renke(bench, codes)
    if manner:
        vane.add_fault(manner)
    bench.go(life, 3.0)
    answer = adopted(bench, life, profile="renke.yaml", name="vane")
    assert (answer.status, answer.data) == ("ok", {"device": "vane", "slave": 2, "from": 1})
    assert (vane.slave, vane.format.baudrate) == (2, line)
    slave = life.running.now.slave("vane")
    assert slave is not None
    assert (slave.id, slave.profile) == (2, "renke.yaml")
    bench.go(life, 5.0)
    assert [each.values for each in life.readings if each.device == "vane"][-1] == {"wind_direction": 5, "sector": 5}
    bench.cut()
    assert bench.begin().place("vane") == 2


def test_one_whose_factory_rate_has_no_code_is_brought_back_to_it_where_it_refuses(bench: Bench) -> None:
    life = bench.sensors(names=False)
    vane = renke(bench, WITHOUT_4800)
    bench.go(life, 3.0)
    vane.blueprint = dataclasses.replace(vane.blueprint, writable={})
    answer = adopted(bench, life, profile="renke.yaml", name="vane")
    assert (answer.status, answer.code) == ("failed", "refused")
    assert (vane.slave, vane.format.baudrate, life.physical.open) == (1, 4800, ())


def test_an_lfs10_is_not_recognised_as_another_profile(bench: Bench) -> None:
    life = bench.sensors(2)
    renke(bench)
    bench.line.sensors.pop()
    plugged(bench)
    bench.go(life, 3.0)
    assert adopted(bench, life, profile="renke.yaml").code == "not_recognised"
    assert writes(bench) == []


@pytest.mark.parametrize(
    ("profile", "line", "why"),
    [
        ("eh600", 9600, "profile eh600 has no factory settings"),
        ("renke.yaml", 57600, "it cannot be set to the 57600 baud of this line"),
        ("fixed.yaml", 9600, "it cannot be set to the 9600 baud of this line"),
        ("mute.yaml", 4800, "profile mute does not say how its slave id is set"),
        ("ascii.yaml", 4800, "it does not support rtu"),
    ],
)
def test_a_profile_that_cannot_be_adopted_here_is_refused_with_the_reason(
    bench: Bench, profile: str, line: int, why: str
) -> None:
    bench.file.with_name("renke.yaml").write_text(RENKE.replace("CODES", CODES))
    kinds = {"fixed": "slave_id: {register: 9}", "mute": "", "ascii": "slave_id: {register: 9}\nframings: [ascii]"}
    for name, facts in kinds.items():
        bench.file.with_name(f"{name}.yaml").write_text(
            f"name: {name}\ntitle: A device\nfactory: {{id: 1, baudrate: 4800}}\n"
            f'values: [{{name: level, register: 1, type: uint16, unit: "1"}}]\n{facts}\n'
        )
    life = bench.sensors(names=False, baudrate=line)
    answer = adopted(bench, life, profile=profile)
    assert (answer.status, answer.code, answer.facts["param"]) == ("rejected", "not_allowed", "profile")
    assert answer.message.endswith(why)


def test_wherever_it_dies_one_of_another_profile_is_polled_or_can_be_adopted_again(bench: Bench) -> None:
    for turns in range(20, 400, 23):
        bench.renew()
        life = bench.sensors(names=False)
        vane = renke(bench)
        bench.go(life, 3.0)
        task = bench.loop.create_task(life.physical.adopt(AdoptRequest(profile="renke.yaml"), Command("n1")))
        for _ in range(turns):
            bench.turn(life)
            if task.done():
                break
        bench.cut()
        life = bench.begin()
        bench.go(life, 40.0)
        assert not life.physical.open
        if life.running.now.slave("slave-2") is None:
            assert vane.slave == 1
            assert adopted(bench, life, profile="renke.yaml").status == "ok"
        slave = life.running.now.slave("slave-2")
        assert slave is not None
        assert (vane.slave, vane.format.baudrate, slave.profile) == (2, 9600, "renke.yaml")


def test_an_open_adoption_whose_profile_is_gone_waits_for_it(bench: Bench) -> None:
    life = bench.sensors(names=False)
    vane = renke(bench)
    bench.go(life, 3.0)
    task = bench.loop.create_task(life.physical.adopt(AdoptRequest(profile="renke.yaml"), Command("n1")))
    while len(writes(bench)) < 2:
        bench.turn(life)
    bench.cut()
    del task
    file = bench.file.with_name("renke.yaml")
    text = file.read_text()
    file.unlink()
    life = bench.begin()
    bench.go(life, 20.0)
    assert life.physical.open
    file.write_text(text)
    bench.go(life, 60.0)
    assert not life.physical.open
    assert vane.slave == life.place("slave-2") == 2
