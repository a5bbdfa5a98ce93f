"""Any profile is recognised by a scan, and its devices are written by the function that they know."""

from __future__ import annotations

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.jobs.access_end import End
from lfs10d.line.jobs.identification import by_evidence
from lfs10d.line.jobs.register_access import Access, Target
from lfs10d.line.jobs.scan import Scan
from lfs10d.line.jobs.scan_plan import ScanPlan
from lfs10d.line.poller import Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.modbus.bus import Bus, LineRules
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.request import WriteRegister
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Event, Reading
from lfs10d.simulator.blueprint import blueprint_of
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from tests.support.any_profiles import SETTINGS, a_profile
from tests.support.faulty_sensors import add_fault
from tests.support.scans import BUILTIN, RTU, Scanned
from tests.support.simulated import violations
from tests.support.virtual_port import SimulatedPort, VirtualClock, run

SLAVE = 9


def device_of(profile: Profile, absent: list[str]) -> Sensor:
    sensor = Sensor(SLAVE, blueprint=blueprint_of(profile))
    if absent:
        add_fault(sensor, "absent", values=tuple(absent))
    return sensor


def lacking(profile: Profile, data: st.DataObject) -> list[str]:
    """Return optional values that a device lacks, but never its first one; parts of a register are lacked together."""
    main = {(each.function, each.register) for each in profile.values[:1]}
    places = {(each.function, each.register) for each in profile.values if each.optional} - main
    drawn = data.draw(st.lists(st.sampled_from(sorted(places)), max_size=2)) if places else []
    return [each.name for each in profile.values if (each.function, each.register) in drawn]


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(profile=a_profile(settable=True), data=st.data())
def test_a_device_is_recognised_though_it_lacks_what_is_optional(profile: Profile, data: st.DataObject) -> None:
    line = SimulatedLine([device_of(profile, lacking(profile, data))], seed=1)
    known = by_evidence([*BUILTIN.values(), profile])
    scan = Scanned(line, Scan(ScanPlan((SLAVE,), (LineTiming.of(9600),), RTU, known, timeout=0.1))).finish().scan
    (found,) = scan.found
    assert found.profile is profile
    assert found.id_register == SLAVE
    assert violations(line.judge) == 0


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(profile=a_profile(settable=True), value=st.integers(2, 60))
def test_a_setting_is_written_by_the_devices_function_and_nobody_is_read_wrongly(profile: Profile, value: int) -> None:
    sensor = device_of(profile, [])
    line, clock = SimulatedLine([sensor], seed=1), VirtualClock()
    port = SimulatedPort(line, clock, PortSettings("/dev/sim", 9600))
    bus, events = Bus(port, LineRules(echo="off"), clock), list[Event]()
    scheduler = Scheduler(bus.line_timing, 0.0)
    scheduler.replace([DeviceSpec("any", SLAVE, profile, RTU, 1.0)], PollRules(), 0.0)
    poller = Poller(bus, scheduler, events.extend, clock)
    wanted = WriteRegister(SLAVE, SETTINGS + 2, value, profile.write_function)
    target = Target(SLAVE, RTU, profile, None)
    access = Access(target, wanted, pending=scheduler.pending, echo_known=lambda: True, over=lambda _: None)
    poller.submit(access)
    run(poller.turn, port, clock, 4.0)
    assert (access.end, sensor.words[SETTINGS + 2]) == (End.DONE, value)
    assert [each.body[1] for each in line.log if each.body[1] in (6, 16)] == [profile.write_function]
    assert all(each.fault is None for each in events if isinstance(each, Reading))
