"""Any profile, from the simulated device to the payload: what the device says is what is published, or null and why."""

from __future__ import annotations

from typing import Any, cast

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.poller import Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.modbus.bus import Bus, LineRules
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Event, Reading
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.port import SimulatedPort, VirtualClock, run
from lfs10d.simulator.registers import blueprint_of
from lfs10d.simulator.sensor import Sensor
from lfs10d.telemetry.info import DeviceInfo
from tests.support.stations import instant, station

WIDTHS = {"int16": 1, "uint16": 1, "int32": 2, "uint32": 2, "int64": 4, "uint64": 4, "float32": 2, "float64": 4}
SLAVE = 9


@st.composite
def a_value(draw: st.DrawFn, number: int, register: int) -> tuple[dict[str, Any], int]:
    """Return the keys of a value at a register, and how many registers it fills."""
    value: dict[str, Any] = {"name": f"x{number}", "register": register, "optional": draw(st.booleans())}
    if draw(st.integers(0, 3)) == 0:
        value["interval"] = "3s"
    kind = draw(st.sampled_from([*WIDTHS, "bcd", "string", "bool", "map"]))
    if kind == "bool":
        return value | {"function": draw(st.sampled_from([1, 2]))}, 1
    value["function"] = draw(st.sampled_from([3, 4]))
    value["byte_order"] = draw(st.sampled_from(["big", "little"]))
    if kind == "string":
        return value | {"type": kind, "length": (length := draw(st.integers(1, 4)))}, length
    if kind == "map":
        return value | {"type": "uint16", "map": {0: "dry", 1: "rain", 7: "snow"}}, 1
    words = WIDTHS.get(kind) or draw(st.integers(1, 3))
    value |= {"type": kind, "unit": "x"}
    if kind == "bcd":
        value["length"] = words
    if words > 1:
        value["word_order"] = draw(st.sampled_from(["high_first", "low_first"]))
    if not kind.startswith("float"):
        value["scale"] = draw(st.sampled_from([1.0, 0.1, 0.01]))
        if kind in WIDTHS and draw(st.booleans()):
            first = draw(st.integers(0, 16 * words - 8))
            value["bits"] = [first, draw(st.integers(first + 7, 16 * words - 1))]
    if kind != "bcd" and draw(st.booleans()):
        value["unavailable"] = [(1 << 16 * words) - 1]
    return value, words


@st.composite
def a_profile(draw: st.DrawFn) -> Profile:
    values, register = [], draw(st.integers(0, 0x8000))
    for number in range(draw(st.integers(1, 6))):
        value, words = draw(a_value(number, register))
        values.append(value)
        register += words + draw(st.sampled_from([0, 0, 1, 3]))
    keys = {"may_skip": draw(st.sampled_from([0, 0, 2]))}
    return Profile.model_validate({"name": "any", "title": "Any device", "values": values, **keys})


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(profile=a_profile(), data=st.data())
def test_what_a_device_says_is_published_and_nothing_else(profile: Profile, data: st.DataObject) -> None:
    sensor = Sensor(SLAVE, blueprint=blueprint_of(profile))
    names = st.lists(st.sampled_from(profile.value_names), max_size=2, unique=True)
    absent = [each for each in data.draw(names) if _optional(profile, each)]
    if absent:
        sensor.add_fault("absent", values=tuple(absent))
    if empty := [each for each in data.draw(names) if _says_nothing(profile, each)]:
        sensor.add_fault("unavailable", values=tuple(empty), last=3.5)
    line = SimulatedLine([sensor])
    clock = VirtualClock(0.0)
    port = SimulatedPort(line, clock, PortSettings("/dev/simulated", 9600))
    scheduler = Scheduler(LineTiming.of(9600), 0.0)
    scheduler.replace([DeviceSpec("any", SLAVE, profile, Codec(Framing.RTU), 1.0)], PollRules(), 0.0)
    events: list[Event] = []
    run(Poller(Bus(port, LineRules(), clock), scheduler, events.extend, clock).turn, port, clock, 6.5)
    readings = [each for each in events if isinstance(each, Reading)]
    assert len(readings) >= 6
    told = station(DeviceInfo("any", SLAVE, None, "any", 1.0, True, None, profile.value_names, profile.units, 3))  # noqa: FBT003 - as it is built
    known: dict[str, object] = {}
    wanted: dict[tuple[int, int, int], tuple[str, ...]] = {
        (each.function, each.address, each.count): tuple(value.name for value in each.values)
        for each in profile.reads()
    }
    begun = -1.0
    for reading in readings:
        for request in line.log:
            if begun < request.ended / 1e9 <= reading.at:
                # What a read spans, and another brings, is not taken from it.
                taken = wanted.get(_asked(request.body), profile.value_names)
                measured = [each for answer in request.answers for each in answer.measured]
                known |= {name: value for name, value in measured if name in taken}
        begun = reading.at
        (payload,) = [
            cast("dict[str, Any]", each.payload)
            for each in told.on_event(reading, instant(reading.at))
            if each.topic == "device/any/telemetry"
        ]
        errors = payload.get("errors", {})
        if payload["quality"] == "bad":
            assert all(known.get(name) is None or name in absent for name in profile.value_names)
            continue
        for name in profile.value_names:
            if name in errors:
                assert payload[name] is None
                assert name in absent or known[name] is None or _says_nothing(profile, name)
            else:
                assert payload[name] == known[name]
                assert isinstance(payload[name], bool | str) == isinstance(known[name], bool | str)
        assert payload["quality"] == ("partial" if errors else "good")


def _asked(body: bytes) -> tuple[int, int, int]:
    """Return function, address and count of a read."""
    return body[1], int.from_bytes(body[2:4], "big"), int.from_bytes(body[4:6], "big")


def _optional(profile: Profile, name: str) -> bool:
    return next(each.optional for each in profile.values if each.name == name)


def _says_nothing(profile: Profile, name: str) -> bool:
    """Whether a value may happen to be what means that there is none."""
    return bool(next(each.unavailable for each in profile.values if each.name == name))
