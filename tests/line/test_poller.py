"""The body of the line thread: posts between exchanges, events at once, the driver's counters now and then."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import pytest

from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.jobs.poll import Poll
from lfs10d.line.poller import COUNTERS_EVERY, Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.modbus.bus import Bus, LineRules, Wait
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Event, Exchanged, FaultCode, PortChanged, Purpose, Reading, UartCounted, UartCounters
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.virtual_port import SimulatedPort, VirtualClock, run

SETTINGS = PortSettings("/dev/simulated")


def spec(slave: int, interval: float = 1.0) -> DeviceSpec:
    profile = load_profile("lfs10", relative_to=Path())
    return DeviceSpec(f"slave-{slave}", slave, profile, Codec(Framing.RTU), interval)


@dataclass
class Rig:
    """Three sensors, two of them polled; `told` is what the sink was given, call by call."""

    clock: VirtualClock = field(default_factory=VirtualClock)
    told: list[list[Event]] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    """When each was given."""

    def __post_init__(self) -> None:
        self.line = SimulatedLine([Sensor(slave) for slave in (1, 2, 3)])
        self.port = SimulatedPort(self.line, self.clock, SETTINGS)
        scheduler = Scheduler(LineTiming.of(9600), 0.0)
        scheduler.replace([spec(1), spec(2)], PollRules(), 0.0)
        self.poller = Poller(Bus(self.port, LineRules(), self.clock), scheduler, self._take, self.clock)

    def _take(self, events: list[Event]) -> None:
        self.told.append(events)
        self.times.append(self.clock.now)

    def run(self, until: float) -> None:
        run(self.poller.turn, self.port, self.clock, until)

    @property
    def events(self) -> list[Event]:
        return [event for events in self.told for event in events]

    def of(self, slave: int) -> list[Reading]:
        return [event for event in self.events if isinstance(event, Reading) and event.device == f"slave-{slave}"]

    def counted(self) -> list[UartCounters]:
        return [event.counters for event in self.events if isinstance(event, UartCounted)]


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_the_sink_is_told_at_most_once_per_exchange_and_never_nothing(rig: Rig) -> None:
    rig.run(20.0)
    assert all(sum(isinstance(event, Exchanged) for event in events) <= 1 for events in rig.told)
    assert all(rig.told)
    exchanges = sum(isinstance(event, Exchanged) for event in rig.events)
    assert len(rig.told) == exchanges + 1  # the opening of the port


def test_with_a_hold_several_good_exchanges_go_together(rig: Rig) -> None:
    rig.poller.hand_over.hold = 0.05
    rig.poller.replace([spec(1, 0.0), spec(2, 0.0)], PollRules())
    rig.run(10.0)
    together = [[event for event in events if isinstance(event, Reading)] for events in rig.told[5:]]
    assert {len(readings) for readings in together} == {2}, "an exchange takes 25 ms and more, two take more than 50"
    assert all(last.at - first.at <= 0.05 for first, last in together)
    assert len(rig.of(1)) > 150


def test_what_is_held_goes_when_its_time_is_over_though_the_line_waits_for_a_silent_sensor(rig: Rig) -> None:
    """Sensor 9 does not answer, so the next exchange ends long after the hold."""
    rig.poller.hand_over.hold = 0.04
    rig.poller.replace([spec(1, 0.0), spec(2, 0.0), spec(9, 0.0)], PollRules(offline_after=1000))
    rig.run(10.0)
    late = [
        at - event.at
        for at, events in zip(rig.times, rig.told, strict=True)
        for event in events
        if isinstance(event, Reading) and event.fault is None
    ]
    assert 0.03 < max(late) <= 0.0401
    assert sum(each > 0.03 for each in late) >= 2, "one before each poll of the silent one, which is asked seldom"


def test_an_exchange_is_told_with_its_reading(rig: Rig) -> None:
    rig.run(0.04)
    assert rig.told[0] == [PortChanged(0.0, None)]
    exchanged, reading = rig.told[1][:2]
    assert isinstance(reading, Reading)
    assert isinstance(exchanged, Exchanged)
    assert (exchanged.slave, exchanged.purpose, exchanged.fault) == (1, Purpose.POLL, None)
    assert exchanged.sent == bytes.fromhex("01030001000295cb")
    assert exchanged.at == reading.at


def test_bytes_nobody_asked_for_are_counted_with_the_next_exchange(rig: Rig) -> None:
    rig.run(0.5)
    rig.line.speak("noise", b"\xff\xff\xff", 600_000_000)
    rig.run(1.5)
    assert sum(event.unsolicited for event in rig.events if isinstance(event, Exchanged)) == 3


def test_a_poll_requested_by_number_comes_back_with_it(rig: Rig) -> None:
    rig.run(0.5)
    rig.poller.read("slave-2", 77)
    rig.poller.read("nobody", 78)
    rig.run(0.9)
    assert [reading.requests for reading in rig.of(2)] == [(), (77,)]


def test_a_submitted_job_is_done_between_exchanges(rig: Rig) -> None:
    rig.run(0.01)
    assert rig.poller.bus.asked is not None
    device = rig.poller.scheduler.devices["slave-1"]
    job = Poll(device, rig.poller.scheduler.pending, due=0.0, purpose=Purpose.REQUEST, request=5)
    rig.poller.submit(job)
    rig.poller.turn(rig.clock.now)
    assert len(rig.told) == 1
    rig.run(0.5)
    assert [reading.requests for reading in rig.of(1)] == [(), (5,)]


def test_what_is_polled_may_change(rig: Rig) -> None:
    rig.run(5.0)
    rig.poller.replace(iter([spec(3)]), PollRules())
    rig.run(10.0)
    assert len(rig.of(3)) == 5
    assert len(rig.of(1)) == 5


def test_another_rate_is_spoken_from_the_next_exchange_on(rig: Rig) -> None:
    rig.run(5.0)
    for sensor in rig.line.sensors:
        sensor.format = Format(19200)
    rig.poller.reconfigure(PortSettings("/dev/simulated", 19200), LineRules())
    rig.run(10.0)
    assert all(reading.fault is None for reading in rig.of(1))
    assert rig.poller.scheduler.timing.baudrate == 19200


def test_the_port_is_lost_and_back(rig: Rig) -> None:
    rig.run(5.0)
    rig.port.unplug()
    rig.run(8.0)
    lost = [reading.fault.code for reading in rig.of(1) + rig.of(2) if reading.fault]
    assert lost == [FaultCode.PORT_LOST] * 2
    wait = rig.poller.turn(rig.clock.now)
    assert isinstance(wait, Wait)
    assert not wait.listen
    rig.port.replug()
    rig.run(10.0)
    assert rig.of(1)[-1].values


def test_the_drivers_counters_are_told_every_few_seconds_since_the_first_opening(rig: Rig) -> None:
    rig.run(1.0)
    assert rig.counted() == [UartCounters(0, 0, 0, 0)]
    rig.port.adapter.framing_errors = 7
    rig.run(COUNTERS_EVERY + 2.0)
    rig.port.unplug()
    rig.run(COUNTERS_EVERY + 4.0)
    rig.port.adapter.framing_errors = 2  # another adapter, another driver
    rig.port.replug()
    rig.run(COUNTERS_EVERY + 8.0)
    rig.port.adapter.framing_errors = 3
    rig.run(2 * COUNTERS_EVERY + 8.0)
    assert [counters.framing for counters in rig.counted()] == [0, 7, 7, 8]


def test_a_driver_without_counters_is_not_told_of(rig: Rig) -> None:
    rig.port.counts = False
    rig.run(30.0)
    assert rig.counted() == []
