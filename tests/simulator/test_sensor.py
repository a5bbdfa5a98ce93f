"""A simulated sensor, well and ill, as a master meets it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lfs10d.simulator.blueprint import Blueprint
from lfs10d.simulator.faults import FaultKind
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.signals import Signal
from lfs10d.simulator.wire import Format
from tests.support.faulty_sensors import add_fault, believable, power_cycle
from tests.support.sensor_values import ID, RATE, Maker, wind_in


def test_a_well_sensor_sends_the_value_that_the_log_tells(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(2))
    for slave in (1, 2, 1):
        body = line.read(slave)
        assert believable(line.answer)
        assert line.answer.sensor.slave == slave
        assert wind_in(body) == pytest.approx(line.answer.values[0], rel=1e-6)
    assert len({request.answers[0].values for request in line.line.log}) == 3


def test_ids_above_247_answer(bench: Maker) -> None:
    assert bench(Sensor(255), Sensor(248)).id_of(248) == 248


def test_an_answer_begins_after_the_turnaround(bench: Maker) -> None:
    line = bench(Sensor(1, turnaround=0.007))
    line.read(1)
    request = line.line.log[0]
    assert request.answers[0].burst.start - request.ended == 7_000_000


def test_jitter_adds_up_to_so_much_and_differs(bench: Maker) -> None:
    line = bench(Sensor(1, turnaround=0.005, jitter=0.01))
    for _ in range(20):
        line.read(1)
    delays = {request.answers[0].burst.start - request.ended for request in line.line.log}
    assert len(delays) > 10
    assert 5_000_000 <= min(delays) <= max(delays) <= 15_000_000


@pytest.mark.parametrize(
    ("body", "code"),
    [
        ("01 04 00 01 00 02", 1),
        ("01 08 00 01 00 02", 1),
        ("01 03 00 01 00 03", 2),
        ("01 03 00 00 00 01", 2),
        ("01 03 00 01 00 00", 3),
        ("01 03 00 01 00 7E", 3),
        ("01 06 00 03 00 01", 2),
        ("01 06 00 05 01 00", 3),
        ("01 06 00 05 00 00", 3),
        ("01 06 00 04 00 03", 3),
    ],
)
def test_what_the_device_does_not_have_is_refused(bench: Maker, body: str, code: int) -> None:
    request = bytes.fromhex(body)
    assert bench(Sensor(1)).exchange(request) == bytes((1, request[1] | 0x80, code))


def test_a_request_of_another_length_is_ignored(bench: Maker) -> None:
    assert bench(Sensor(1)).exchange(bytes.fromhex("01 03 00 01 00 02 00")) is None


def test_silence_begins_and_ends_when_told(bench: Maker) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), "silent", first=2.0, last=3.0)
    heard = []
    for seconds in (1.0, 2.0, 2.5, 3.0):
        line.reach(seconds)
        heard.append(line.id_of(1) is not None)
    assert heard == [True, False, False, True]


def test_a_healed_sensor_keeps_its_other_faults() -> None:
    sensor = Sensor(1)
    add_fault(sensor, "silent")
    kept = add_fault(sensor, "noisy", 0.5)
    sensor.faults = [one for one in sensor.faults if one.kind != "silent"]
    assert sensor.faults == [kept]
    sensor.faults.clear()
    assert sensor.faults == []


def test_without_power_nothing_answers(bench: Maker) -> None:
    line = bench(Sensor(1))
    sensor = line.line.sensor(1)
    sensor.power_cut()
    assert line.id_of(1) is None
    sensor.power_up()
    assert line.id_of(1) == 1


def test_one_that_hangs_is_silent_after_an_exception_until_the_next_power_cycle(bench: Maker) -> None:
    line = bench(Sensor(1))
    sensor = line.line.sensor(1)
    add_fault(sensor, "hangs")
    assert line.id_of(1) == 1
    assert line.read(1, 3, 1) == bytes.fromhex("01 83 02")
    assert line.id_of(1) is None
    power_cycle(sensor)
    assert line.id_of(1) == 1


def test_one_that_hangs_is_silent_after_a_frame_it_could_not_read(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(2))
    add_fault(line.line.sensor(1), "hangs")
    line.port.write(b"\x01\x03\x00\x01")
    line.listen(0.1)
    assert line.id_of(1) is None
    assert line.id_of(2) == 2


def test_a_shy_sensor_ignores_the_request_after_one_to_the_dead(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(2))
    add_fault(line.line.sensor(1), "shy")
    line.read(77)
    assert line.id_of(1) is None
    assert line.id_of(1) == 1
    line.read(2)
    assert line.id_of(1) == 1


def test_a_sensor_that_needs_rest_ignores_what_comes_too_soon_after_its_answer(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(2))
    add_fault(line.line.sensor(1), "needs_rest", delay=0.2)
    assert line.id_of(1) == 1
    assert line.id_of(1) is None
    for _ in range(20):
        line.id_of(2)
    assert line.id_of(1) == 1


def test_a_sensor_that_sleeps_loses_the_request_that_wakes_it(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(2))
    add_fault(line.line.sensor(1), "sleeps", delay=0.2)
    assert line.id_of(1) is None
    assert line.id_of(1) == 1
    for _ in range(20):
        line.id_of(2)
    assert line.id_of(1) is None
    assert line.id_of(1) == 1


def test_a_broadcast_is_obeyed_by_all_and_answered_by_nobody(bench: Maker) -> None:
    line = bench(Sensor(1), Sensor(2))
    assert line.write(0, RATE, 2) is None
    assert line.heard == b""
    assert {sensor.format.baudrate for sensor in line.line.sensors} == {19200}


def test_an_echo_at_once_of_a_broadcast_is_none(bench: Maker) -> None:
    line = bench(Sensor(1))
    add_fault(line.line.sensor(1), "at_once")
    line.write(0, ID, 4)
    assert line.heard == b""
    assert line.id_of(4) == 4


def test_a_wildcard_answers_255_too(bench: Maker) -> None:
    line = bench(Sensor(1))
    assert line.id_of(255) is None
    add_fault(line.line.sensor(1), "wildcard")
    assert line.id_of(255) == 1
    assert line.id_of(254) is None


def test_other_devices_are_just_data(bench: Maker) -> None:
    meter = Blueprint(
        "meter",
        (Signal(10, "uint16", scale=0.1), Signal(20, "int32")),
        words={30: 7},
        writable={30: range(10)},
        functions=frozenset({3, 4, 6}),
        max_words=2,
        check="sum",
    )
    sensor = Sensor(5, blueprint=meter, source=lambda now: 12.34 if now else 0.0, framing="ascii")
    line = bench(sensor, framing="ascii")
    assert line.read(5, 10, 1) == bytes.fromhex("05 03 02 00 7B")
    assert line.exchange(bytes.fromhex("05 04 00 14 00 02")) == bytes.fromhex("05 04 04 00 00 00 0C")
    assert line.write(5, 30, 8) == bytes.fromhex("05 06 00 1E 00 08")
    assert line.read(5, 30, 1) == bytes.fromhex("05 03 02 00 08")
    power_cycle(sensor)
    assert repr(sensor) == "<Sensor 5 at 9600>"
    add_fault(sensor, FaultKind.NAN)
    assert line.read(5, 10, 1) == bytes.fromhex("05 03 02 FF FF")


def test_a_sensor_at_an_odd_rate_keeps_its_register_as_it_was() -> None:
    assert Sensor(1, format=Format(38400)).words[RATE] == 1
    assert Sensor(1, format=Format(19200)).words[RATE] == 2


def test_one_made_another_kind_refuses_what_that_kind_refuses(bench: Maker) -> None:
    sensor = Sensor(1)
    line = bench(sensor)
    assert line.write(1, RATE, 1) == bytes.fromhex("01 06 00 04 00 01")
    sensor.memory.blueprint = replace(sensor.blueprint, writable={})
    assert line.write(1, RATE, 1) == bytes.fromhex("01 86 02")
    sensor.memory.blueprint = replace(sensor.blueprint, functions=frozenset({4}))
    assert line.write(1, RATE, 1) == bytes.fromhex("01 86 01")
