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
from lfs10d.simulator.blueprint import blueprint_of
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.telemetry.info import DeviceInfo
from tests.support.any_profiles import a_profile, certificates
from tests.support.faulty_sensors import add_fault
from tests.support.stations import instant, station
from tests.support.virtual_port import SimulatedPort, VirtualClock, run

SLAVE = 9


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(profile=a_profile(), data=st.data())
def test_what_a_device_says_is_published_and_nothing_else(profile: Profile, data: st.DataObject) -> None:
    sensor = Sensor(SLAVE, blueprint=blueprint_of(profile))
    names = st.lists(st.sampled_from(profile.value_names), max_size=2, unique=True)
    absent = _with_their_other_halves(profile, [each for each in data.draw(names) if _optional(profile, each)])
    if absent:
        add_fault(sensor, "absent", values=tuple(absent))
    if empty := [each for each in data.draw(names) if _says_nothing(profile, each)]:
        add_fault(sensor, "unavailable", values=tuple(empty), last=3.5)
    if stuck := data.draw(names):
        add_fault(sensor, "stuck", values=tuple(stuck), first=2.5)
    calibration = data.draw(certificates(profile))
    profile = profile.calibrated(calibration)
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
            assert all(
                known.get(name) is None or name in absent or _says_nothing(profile, name)
                for name in profile.value_names
            )
            continue
        for name in profile.value_names:
            if name in errors:
                assert payload[name] is None
                assert name in absent or known[name] is None or _says_nothing(profile, name)
            else:
                assert _is(payload[name], known[name], calibration.get(name), _modulo(profile, name)), name
                assert isinstance(payload[name], bool | str) == isinstance(known[name], bool | str)
        assert payload["quality"] == ("partial" if errors else "good")


def _asked(body: bytes) -> tuple[int, int, int]:
    """Return function, address and count of a read."""
    return body[1], int.from_bytes(body[2:4], "big"), int.from_bytes(body[4:6], "big")


def _optional(profile: Profile, name: str) -> bool:
    return next(each.optional for each in profile.values if each.name == name)


def _with_their_other_halves(profile: Profile, names: list[str]) -> list[str]:
    places = {(each.function, each.register) for each in profile.values if each.name in names}
    return [each.name for each in profile.values if (each.function, each.register) in places]


def _modulo(profile: Profile, name: str) -> float | None:
    return next(each.modulo for each in profile.values if each.name == name)


def _is(published: object, known: object, certificate: tuple[float, float] | None, modulo: float | None) -> bool:
    """Whether what is published is what the device measured, by its certificate."""
    if certificate is None or not isinstance(known, int | float):
        return published == known
    wanted = known * certificate[0] + certificate[1]
    difference = cast("float", published) - wanted
    if modulo is not None:
        assert 0 <= cast("float", published) < modulo
        difference = (difference + modulo / 2) % modulo - modulo / 2
    return abs(difference) <= 1e-6 * max(1.0, abs(wanted))


def _says_nothing(profile: Profile, name: str) -> bool:
    """Whether a value may happen to be what means that there is none."""
    return bool(next(each.unavailable for each in profile.values if each.name == name))
