"""`line/baudrate` on a whole line in virtual time: every way sensors can take it."""

from __future__ import annotations

from typing import Any

import pytest

from lfs10d.command import Command, Result
from lfs10d.reconfiguration.adopt_request import AdoptRequest
from lfs10d.simulator.judge import HeardRequest
from lfs10d.simulator.sensor import Sensor
from tests.support.faulty_sensors import add_fault, power_cycle
from tests.support.lives import Bench, Life


def change(bench: Bench, life: Life, to: int = 19200, *, power_cycle: bool = False, dry_run: bool = False) -> Result:
    request = life.physical.baudrate(to, power_cycle=power_cycle, dry_run=dry_run, call=Command("b1"))
    return bench.ask(life, request, within=400.0)


def rates(bench: Bench) -> list[int]:
    return [sensor.format.baudrate for sensor in bench.line.sensors]


def fresh(bench: Bench, life: Life, seconds: float = 10.0) -> dict[str, int]:
    """Return how many good readings each device has from now on."""
    before = len(life.readings)
    bench.go(life, seconds)
    good = [reading.device for reading in life.readings[before:] if reading.values]
    return {name: good.count(name) for name in good}


@pytest.mark.parametrize("echo", [False, True])
@pytest.mark.parametrize("manner", [None, "at_once", "echo_losing", "slow_flash", "late"])
def test_every_sensor_and_the_port_move(bench: Bench, manner: str | None, echo: bool) -> None:  # noqa: FBT001 - the test's parameter
    life = bench.sensors(3, 4, 5, echo=echo)
    bench.go(life, 5.0)
    for sensor in bench.line.sensors:
        if manner:
            add_fault(sensor, manner)
    answer = change(bench, life)
    assert (answer.status, answer.data) == ("ok", {"from": 9600, "to": 19200, "pending": []})
    assert rates(bench) == [19200] * 3
    assert life.told("baudrate_changed") == [{"from": 9600, "to": 19200}]
    for sensor in bench.line.sensors:
        sensor.faults.clear()
    assert life.running.now.config.line.baudrate == 19200
    assert min(fresh(bench, life).values()) >= 8
    bench.cut()
    assert bench.begin().running.now.config.line.baudrate == 19200


def test_a_dry_run_writes_nothing(bench: Bench) -> None:
    life = bench.sensors(3, 4)
    bench.go(life, 3.0)
    assert change(bench, life, dry_run=True).status == "ok"
    assert not [request for request in bench.line.log if request.body[1:2] == b"\x06"]


def test_nothing_is_written_unless_every_sensor_answers(bench: Bench) -> None:
    life = bench.sensors(3, 4)
    add_fault(bench.line.sensor(4), "silent")
    bench.go(life, 3.0)
    answer = change(bench, life)
    assert (answer.status, answer.code) == ("rejected", "timeout")
    assert not [request for request in bench.line.log if request.body[1:2] == b"\x06"]


@pytest.mark.parametrize("fault", ["power_cycle", "stores_but_ignores"])
def test_a_canary_that_wants_a_power_cycle_is_written_back_and_nobody_else_is_touched(bench: Bench, fault: str) -> None:
    life = bench.sensors(3, 4)
    for sensor in bench.line.sensors:
        add_fault(sensor, fault)
    bench.go(life, 3.0)
    answer = change(bench, life)
    assert (answer.status, answer.code) == ("failed", "power_cycle_needed")
    assert [sensor.words[4] for sensor in bench.line.sensors] == [1, 1]
    assert not life.physical.open
    for sensor in bench.line.sensors:
        power_cycle(sensor)
    assert rates(bench) == [9600, 9600]
    assert min(fresh(bench, life).values()) >= 8


@pytest.mark.parametrize(("fault", "code"), [("silent", "not_verified"), ("power_cycle", "rolled_back")])
def test_where_a_later_one_fails_the_others_are_moved_back(bench: Bench, fault: str, code: str) -> None:
    life = bench.sensors(3, 4, 5)
    bench.go(life, 3.0)
    second = bench.line.sensor(4)
    if fault == "silent":
        struck: list[object] = []

        def strike(request: HeardRequest) -> None:
            if request.body[:2] == b"\x04\x06" and not struck:
                struck.append(add_fault(second, "silent"))

        bench.line.after_each_request(strike)
    else:
        add_fault(second, fault)
    answer = change(bench, life)
    assert (answer.status, answer.code) == ("failed", code)
    where: dict[str, Any] = {"s3": 9600, "s4": None if code == "not_verified" else 9600, "s5": 9600}
    assert answer.data == {"where": where}
    second.faults.clear()
    power_cycle(second)
    bench.go(life, 120.0)
    assert rates(bench) == [9600] * 3
    assert not life.physical.open
    assert min(fresh(bench, life).values()) >= 8


def test_with_power_cycle_all_are_written_and_followed_until_they_come_up(bench: Bench) -> None:
    life = bench.sensors(3, 4)
    for sensor in bench.line.sensors:
        add_fault(sensor, "power_cycle")
    bench.go(life, 3.0)
    answer = change(bench, life, power_cycle=True)
    assert (answer.status, answer.data) == ("ok", {"from": 9600, "to": 19200, "pending": ["s3", "s4"]})
    assert life.running.now.config.line.baudrate == 9600
    assert min(fresh(bench, life).values()) >= 7
    power_cycle(bench.line.sensor(3))
    bench.go(life, 60.0)
    assert life.running.now.config.line.baudrate == 19200
    bench.cut()
    life = bench.begin()
    bench.go(life, 5.0)
    assert life.physical.open
    power_cycle(bench.line.sensor(4))
    bench.go(life, 60.0)
    assert not life.physical.open
    assert min(fresh(bench, life).values()) >= 8


def test_two_sensors_of_one_id_of_which_one_moves_are_told_and_moved_back(bench: Bench) -> None:
    life = bench.sensors(3, 4)
    twin = bench.line.add(Sensor(4))
    add_fault(twin, "power_cycle")
    bench.go(life, 3.0)
    answer = change(bench, life)
    assert (answer.status, answer.code) == ("failed", "duplicate_id")
    assert rates(bench) == [9600] * 3
    assert [sensor.words[4] for sensor in bench.line.sensors[:2]] == [1, 1]
    assert life.told("duplicate_id") == [{"device": "s4", "slave": 4, "from": 4}]
    assert not life.physical.open


def test_while_sensors_are_still_to_come_up_nothing_else_is_done_to_them(bench: Bench) -> None:
    life = bench.sensors(3, 4, 5)
    for sensor in bench.line.sensors[:2]:
        add_fault(sensor, "power_cycle")
    bench.go(life, 3.0)
    assert change(bench, life, power_cycle=True).data == {"from": 9600, "to": 19200, "pending": ["s3", "s4"]}
    assert life.running.now.config.line.baudrate == 19200, "s5 is there already"
    busy = bench.readdress(life, "s3", 9)
    assert (busy.status, busy.code) == ("rejected", "busy")
    adopting = bench.ask(life, life.physical.adopt(AdoptRequest(), Command("n1")))
    assert (adopting.status, adopting.code) == ("rejected", "busy")
    assert bench.readdress(life, "s5", 9, id="a2").status == "ok", "it is there already"
    for sensor in bench.line.sensors[:2]:
        power_cycle(sensor)
    bench.go(life, 60.0)
    assert not life.physical.open
    assert set(fresh(bench, life)) == {"s3", "s4", "s5"}


def test_the_rate_of_now_is_not_called_settled_while_sensors_may_come_up_at_another(bench: Bench) -> None:
    life = bench.sensors(3, 4)
    for sensor in bench.line.sensors:
        add_fault(sensor, "power_cycle")
    bench.go(life, 3.0)
    assert change(bench, life, power_cycle=True).status == "ok"
    answer = change(bench, life, to=9600)
    assert (answer.status, answer.code) == ("rejected", "busy")


SLAVES = {
    "none": "[]",
    "disabled": "[{id: 3, name: s3, enabled: false}]",
    "foreign": "[{id: 3, profile: eh600}]",
    "mixed": "[{id: 3, name: s3}, {id: 4, profile: eh600}]",
}


@pytest.mark.parametrize("dry_run", [False, True])
@pytest.mark.parametrize(
    ("slaves", "code"), [("none", None), ("disabled", None), ("foreign", "not_allowed"), ("mixed", "not_allowed")]
)
def test_whatever_is_configured_there_is_one_answer_and_it_is_true(
    bench: Bench, slaves: str, code: str | None, *, dry_run: bool
) -> None:
    bench.sensors(3, names=False)
    bench.file.write_text(bench.file.read_text().replace("slaves: []", f"slaves: {SLAVES[slaves]}"))
    bench.cut()
    life = bench.begin()
    bench.go(life, 3.0)
    life.request("line/baudrate", id="b1", to=19200, dry_run=dry_run)
    bench.go(life, 30.0)
    (response,) = bench.responses  # two before where no slave was configured, the first of them false
    error = response["error"]
    assert (response["status"], error and error["code"]) == ("ok" if code is None else "rejected", code)
    moved = code is None and not dry_run
    assert life.running.now.config.line.baudrate == (19200 if moved else 9600)
    assert not life.physical.open
    bench.cut()
    assert bench.begin().running.now.config.line.baudrate == (19200 if moved else 9600)


def test_a_device_removed_while_its_change_is_carried_out_has_one_answer(bench: Bench) -> None:
    life = bench.sensors(3, 4)
    bench.go(life, 3.0)
    life.request("device/readdress", id="r1", device="s3", to=9)
    while not life.physical.open:
        bench.turn(life)
    bench.ask(life, removed(life, "s3"))
    bench.go(life, 60.0)
    assert len(bench.responses) == 1
    assert not life.physical.open


async def removed(life: Life, device: str) -> Result:
    """Take a device out of the configuration, as `device/remove` does."""
    await life.running.change(lambda now: now.changes.removing(device, now.file_values))
    return Result("ok")
