"""Newcomers of other profiles are adopted at their factory's rate."""

from __future__ import annotations

import dataclasses

import pytest

from lfs10d.command import Command
from lfs10d.profiles.library import parse_profile
from lfs10d.reconfiguration.adopt_request import AdoptRequest
from lfs10d.simulator.blueprint import blueprint_of
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.faulty_sensors import add_fault
from tests.support.lives import Bench
from tests.support.newcomers import adopted, plugged, writes

pytestmark = pytest.mark.long(1)


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


@pytest.mark.parametrize(("codes", "line"), [(CODES, 9600), (WITHOUT_4800, 9600), (WITHOUT_4800, 19200), (CODES, 4800)])
@pytest.mark.parametrize("manner", [None, "at_once"])
def test_one_of_another_profile_is_adopted_at_its_factorys_rate(
    bench: Bench, codes: str, line: int, manner: str | None
) -> None:
    life = bench.sensors(names=False, baudrate=line)
    vane = renke(bench, codes)
    if manner:
        add_fault(vane, manner)
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
    vane.memory.blueprint = dataclasses.replace(vane.blueprint, writable={})
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
        ("mute.yaml", 4800, "profile mute does not define how its slave id is set"),
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
