"""`line/baudrate` cut short where sensors obey at power-up: what answers is put back at once, whoever is lost."""

from __future__ import annotations

import pytest

from tests.support.faulty_sensors import add_fault, power_cycle
from tests.support.lives import Bench, Life
from tests.support.volatile_disk import PowerCutError

SLAVES = tuple(range(3, 11))
CODE_9600 = 1
AT_ONCE = 3.0
"""s after the start within which everybody who answers is written back: a look at each, 32 ms, and at one lost."""


def cut_short(bench: Bench, how: str, *, sensor_fault: str = "power_cycle", written: int = 6) -> None:
    """Begin a change of eight sensors to 19200 and end the daemon when so many have been written."""
    life = bench.sensors(*SLAVES)
    for sensor in bench.line.sensors:
        add_fault(sensor, sensor_fault)
    bench.go(life, 5.0)
    life.request("line/baudrate", id="c1", to=19200, power_cycle=True)
    while sum(sensor.words[4] != CODE_9600 for sensor in bench.line.sensors) < written:
        bench.turn(life)
    if how == "sigterm":
        life.end()
    bench.cut()


def stored(bench: Bench) -> set[int]:
    """Return the slaves that would come up at 19200."""
    return {sensor.slave for sensor in bench.line.sensors if sensor.words[4] != CODE_9600}


def fresh(bench: Bench, life: Life, seconds: float = 10.0) -> dict[str, int]:
    before = len(life.readings)
    bench.go(life, seconds)
    good = [reading.device for reading in life.readings[before:] if reading.values]
    return {name: good.count(name) for name in good}


@pytest.mark.parametrize("how", ["sigterm", "cut"])
@pytest.mark.parametrize("lost", [3, 5, 8])
def test_one_that_is_lost_does_not_keep_the_others_from_being_put_back_at_once(
    bench: Bench, how: str, lost: int
) -> None:
    cut_short(bench, how)
    straggler = bench.line.sensor(lost)
    add_fault(straggler, "silent")
    life = bench.begin()
    bench.go(life, AT_ONCE)
    assert stored(bench) == {lost}
    for sensor in bench.line.sensors:
        if sensor is not straggler:
            power_cycle(sensor)
    polled = fresh(bench, life)
    assert {name: count >= 8 for name, count in polled.items()} == {
        f"s{slave}": True for slave in SLAVES if slave != lost
    }
    assert life.physical.open, "it is still looked for"
    straggler.faults = [one for one in straggler.faults if one.kind != "silent"]
    bench.go(life, 30.0)
    assert stored(bench) == set()
    assert not life.physical.open
    power_cycle(straggler)
    assert min(fresh(bench, life).values()) >= 8


def test_of_sensors_that_obeyed_at_once_those_that_answer_are_moved_back_before_one_that_is_lost(bench: Bench) -> None:
    cut_short(bench, "sigterm", sensor_fault="at_once")
    add_fault(bench.line.sensor(3), "silent")
    life = bench.begin()
    bench.go(life, 20.0)
    assert stored(bench) == {3}
    assert len(fresh(bench, life)) == len(SLAVES) - 1


def test_the_request_is_answered_once_though_one_is_never_found(bench: Bench) -> None:
    cut_short(bench, "cut")
    add_fault(bench.line.sensor(4), "silent")
    life = bench.begin()
    bench.go(life, 100.0)
    (response,) = bench.responses
    assert (response["status"], response["error"]["code"]) == ("failed", "not_verified")
    assert response["data"]["where"] == {f"s{slave}": None if slave == 4 else 9600 for slave in SLAVES}
    bench.go(life, 90.0)
    assert len(bench.responses) == 1


def test_a_lost_one_is_asked_at_the_line_s_own_rate_first(bench: Bench) -> None:
    cut_short(bench, "sigterm")
    add_fault(bench.line.sensor(5), "silent")
    life = bench.begin()
    before = len(bench.line.log)
    bench.go(life, 60.0)
    asked = [
        9600 if request.ended - request.begun > 6_000_000 else 19200  # 8 bytes, in ns
        for request in bench.line.log[before:]
        if request.frame[:2] == b"\x05\x03"
    ]
    assert asked[:2] == [9600, 19200]
    assert asked.count(19200) >= 3, "it is looked for there again and again"


def test_where_the_line_s_rate_had_moved_it_moves_back_before_the_last_one_is_found(bench: Bench) -> None:
    """Cut where the file of changes says 19200 already and the journal is not closed yet; then one is lost."""
    life = moved_but_not_closed(bench)
    bench.go(life, 15.0)
    assert life.running.now.config.line.baudrate == 9600
    assert {name: count >= 8 for name, count in fresh(bench, life).items()} == {"s3": True, "s4": True}
    bench.line.sensor(5).faults.clear()
    bench.go(life, 60.0)
    assert not life.physical.open
    assert stored(bench) == set()
    assert min(fresh(bench, life).values()) >= 8


def moved_but_not_closed(bench: Bench) -> Life:
    """Return the life after such a cut, the sensor 5 silent."""
    for last in range(60):
        bench.renew()
        life = bench.sensors(3, 4, 5)
        bench.go(life, 3.0)
        bench.files.steps_left = bench.files.steps + last
        try:
            life.request("line/baudrate", id="c1", to=19200)
            while bench.files.steps < bench.files.steps_left and not bench.responses:
                bench.turn(life)
        except PowerCutError:
            pass
        bench.cut(*bench.files.seen)
        add_fault(bench.line.sensor(5), "silent")
        life = bench.begin()
        if life.running.now.config.line.baudrate == 19200 and life.physical.open:
            return life
    pytest.fail("no such cut")
