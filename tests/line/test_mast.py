"""A mast of eight devices of eight makers on one line, for an hour in virtual time: each by its profile."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.poller import Poller
from lfs10d.line.read_plan import ABSENT_AGAIN
from lfs10d.line.scheduler import Scheduler
from lfs10d.modbus.bus import Bus, LineRules
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Event, FaultCode, Reading
from lfs10d.simulator.blueprint import blueprint_of
from lfs10d.simulator.burst import MASTER
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.signals import Published
from tests.support.faulty_sensors import add_fault
from tests.support.lines import Rig
from tests.support.simulated import violations
from tests.support.virtual_port import SimulatedPort, VirtualClock

HOUR = 3600.0
INTERVAL = 10.0
"""Seconds: the hour is the same at any interval, and the test is short."""

GILL = {
    "name": "gill",
    "title": "An ultrasonic anemometer with floats, NaN in calm, a status word and a heater",
    "values": [
        {"name": "wind_speed", "register": 4, "type": "float32", "word_order": "low_first", "unit": "m/s"},
        {
            "name": "wind_direction",
            "register": 6,
            "type": "float32",
            "word_order": "low_first",
            "unit": "°",
            "modulo": 360,
        },
        {
            "name": "status",
            "register": 20,
            "type": "uint16",
            "bits": [4, 5],
            "map": {0: "ok", 1: "warm", 2: "ice", 3: "x"},
        },
        {"name": "heater", "register": 3, "function": 1},
        {"name": "serial", "register": 30, "type": "string", "length": 4, "interval": "5m"},
    ],
    "barrier": {"register": 40, "count": 3},
}
STATION = {
    "name": "station",
    "title": "A compact station whose rain gauge is not fitted",
    "values": [
        {"name": "wind_speed", "register": 500, "type": "uint16", "scale": 0.1, "unit": "m/s", "range": [0, 60]},
        {"name": "humidity", "register": 501, "type": "uint16", "scale": 0.1, "unit": "%", "unavailable": [0xFFFF]},
        {"name": "rain", "register": 502, "type": "uint16", "scale": 0.1, "unit": "mm", "optional": True},
        {"name": "temperature", "register": 503, "type": "int16", "scale": 0.1, "unit": "°C", "range": [-40, 80]},
    ],
    "barrier": {"register": 2000, "count": 3},
}


def builtin(name: str) -> Profile:
    return load_profile(name, relative_to=Path())


MAST = {
    1: builtin("lfs10"),
    2: builtin("renke-rs-fsjt"),
    3: builtin("renke-rs-fxjt"),
    4: builtin("ecowitt-wn90lp"),
    5: builtin("dfrobot-sen0482"),
    6: builtin("eh600"),
    7: Profile.model_validate(GILL),
    8: Profile.model_validate(STATION),
}


def mast(*, interval: float = INTERVAL) -> Rig:
    """Return the mast and who polls it."""
    sensors = {slave: Sensor(slave, blueprint=blueprint_of(profile)) for slave, profile in MAST.items()}
    add_fault(sensors[7], "nan", first=600.0, last=1200.0, values=("wind_direction",))
    add_fault(sensors[8], "absent", values=("rain",))
    add_fault(sensors[8], "unavailable", first=1000.0, last=2000.0, values=("humidity",))
    add_fault(sensors[6], "needs_rest", delay=0.5)
    line = SimulatedLine(sensors.values())
    clock = VirtualClock(0.0)
    port = SimulatedPort(line, clock, PortSettings("/dev/simulated", 9600))
    scheduler = Scheduler(LineTiming.of(9600), 0.0)
    specs = [
        DeviceSpec(f"slave-{slave}", slave, profile, Codec(Framing.RTU), interval, request_gap=0.5 * (slave == 6))
        for slave, profile in MAST.items()
    ]
    scheduler.replace(specs, PollRules(), 0.0)
    events: list[Event] = []
    return Rig(line, clock, port, Poller(Bus(port, LineRules(), clock), scheduler, events.extend, clock), events)


@pytest.fixture(scope="module")
def run() -> Rig:
    """Give an hour of the mast."""
    return mast().run(HOUR)


def meant(run: Rig) -> dict[str, list[tuple[float, dict[str, Published | None]]]]:
    """Return what each device said in each of its answers, with the time in s, by its name in the configuration."""
    said: dict[str, list[tuple[float, dict[str, Published | None]]]] = {}
    for request in run.line.log:
        for answer in request.answers:
            said.setdefault(f"slave-{request.body[0]}", []).append((request.ended / 1e9, dict(answer.measured)))
    return said


def test_nobody_is_slowed_and_every_poll_is_a_sample_with_a_value(run: Rig) -> None:
    polls = Counter(reading.device for reading in run.readings)
    assert set(polls) == {f"slave-{slave}" for slave in MAST}
    assert all(abs(count - HOUR / INTERVAL) <= 1 for count in polls.values()), polls
    assert [reading for reading in run.readings if reading.fault is not None] == []
    assert sum(reading.overruns for reading in run.readings) == 0


def test_every_value_is_what_the_device_said_in_this_poll_and_none_is_missing(run: Rig) -> None:
    said = meant(run)
    before: dict[str, float] = {}
    newest: dict[str, dict[str, Published | None]] = {device: {} for device in said}
    for reading in run.readings:
        assert reading.values is not None
        begun, before[reading.device] = before.get(reading.device, -1.0), reading.at
        answers = [values for at, values in said[reading.device] if begun < at <= reading.at]
        read = {name for values in answers for name in values}
        for each in answers:
            newest[reading.device] |= each
        for name, value in reading.values.items():
            expected = None if name in reading.value_errors else newest[reading.device][name]
            assert value == expected, (reading, name)
            assert isinstance(value, str | bool) == isinstance(expected, str | bool)
        assert set(reading.values) - read <= {"serial", "rain"}  # the slow one, and the absent one
        assert tuple(reading.values) == MAST[int(reading.device.removeprefix("slave-"))].value_names


def test_only_what_the_device_cannot_say_is_null(run: Rig) -> None:
    errors = Counter(
        (reading.device, name, code) for reading in run.readings for name, code in reading.value_errors.items()
    )
    polls = round(HOUR / INTERVAL)
    assert set(errors) == {
        ("slave-7", "wind_direction", FaultCode.NOT_FINITE),
        ("slave-8", "rain", FaultCode.EXCEPTION),
        ("slave-8", "humidity", FaultCode.UNAVAILABLE),
    }
    assert errors["slave-8", "rain", FaultCode.EXCEPTION] == len(of(run, 8))
    assert abs(errors["slave-7", "wind_direction", FaultCode.NOT_FINITE] - polls / 6) <= 1
    assert abs(errors["slave-8", "humidity", FaultCode.UNAVAILABLE] - polls / 3.6) <= 1


def of(run: Rig, slave: int) -> list[Reading]:
    return [reading for reading in run.readings if reading.device == f"slave-{slave}"]


def test_the_absent_gauge_is_asked_every_ten_minutes_and_the_rest_in_one_poll_of_two_reads(run: Rig) -> None:
    asked = [
        int.from_bytes(request.body[2:4], "big")
        for request in run.line.log
        if request.speaker is MASTER and request.body[0] == 8 and request.body[1] == 3
    ]
    assert asked.count(502) == 1 + (HOUR - 1) // ABSENT_AGAIN
    assert asked.count(503) == len(of(run, 8))


def test_the_slow_text_is_read_every_five_minutes_and_has_its_age_in_between(run: Rig) -> None:
    serial = [request for request in run.line.log if request.body[:4] == bytes((7, 3, 0, 30))]
    assert len(serial) == HOUR / 300
    ages = [reading.ages.get("serial", 0.0) for reading in of(run, 7)]
    assert max(ages) < 300
    assert sum(age > INTERVAL for age in ages) > 0.9 * len(ages)


def test_one_that_wants_500_ms_of_rest_has_it_and_nobody_is_asked_too_early(run: Rig) -> None:
    assert all(reading.failed_attempts == () for reading in of(run, 6))
    assert violations(run.line.judge) == 0
