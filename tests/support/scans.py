"""A scan on a simulated line in virtual time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from lfs10d.line.jobs.identification import FoundDevice, by_evidence
from lfs10d.line.jobs.scan import Scan
from lfs10d.line.jobs.scan_plan import ScanPlan
from lfs10d.line.poller import Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.modbus.bus import Bus, LineRules
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.reading import Event, Exchanged
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from tests.support.faulty_sensors import add_fault
from tests.support.virtual_port import SimulatedPort, VirtualClock, run

BUILTIN = {name: load_profile(name, relative_to=Path()) for name in builtin_names()}
PROFILES = by_evidence(BUILTIN.values())
RTU = Codec(Framing.RTU)
ALL = range(1, 256)
LONGEST = 400.0
"""Virtual seconds after which a scan counts as endless."""


def search(ids: Iterable[int], rates: Iterable[int] = (9600,), *, timeout: float = 0.1) -> ScanPlan:
    return ScanPlan(tuple(ids), tuple(LineTiming.of(rate) for rate in rates), RTU, PROFILES, timeout=timeout)


def line_of(*sensors: Sensor | int) -> SimulatedLine:
    """Return a line with these sensors; a number is a healthy LFS10 with that id at 9600 baud."""
    line = SimulatedLine(seed=1, keep_log=True)
    for sensor in sensors:
        line.add(Sensor(sensor) if isinstance(sensor, int) else sensor)
    return line


def ill(slave: int, kind: str, **particulars: float) -> Sensor:
    sensor = Sensor(slave)
    add_fault(sensor, kind, **particulars)
    return sensor


@dataclass
class Scanned:
    """A scan that runs on a line in virtual time, with everything that was heard."""

    line: SimulatedLine
    scan: Scan
    echo: bool = False
    latency: float = 0.0
    events: list[Event] = field(default_factory=list)
    clock: VirtualClock = field(default_factory=VirtualClock)

    def __post_init__(self) -> None:
        self.port = SimulatedPort(self.line, self.clock, PortSettings("/dev/sim"), echo=self.echo, latency=self.latency)
        bus = Bus(self.port, LineRules(), self.clock)
        self.scheduler = Scheduler(bus.line_timing, 0.0)
        self.poller = Poller(bus, self.scheduler, self.events.extend, self.clock)
        self.poller.submit(self.scan)

    def pass_time(self, seconds: float) -> None:
        run(self.poller.turn, self.port, self.clock, self.clock.now + seconds)

    def finish(self) -> Scanned:
        while not self.scan.over:
            assert self.clock.now < LONGEST, "the scan does not end"
            self.pass_time(0.5)
        return self

    @property
    def exchanges(self) -> list[Exchanged]:
        return [event for event in self.events if isinstance(event, Exchanged)]


def scanned(line: SimulatedLine, ids: Iterable[int] = ALL, rates: Iterable[int] = (9600,), **adapter: float) -> Scanned:
    echo, latency = bool(adapter.get("echo")), adapter.get("latency", 0.0)
    done = Scanned(line, Scan(search(ids, rates)), echo=echo, latency=latency).finish()
    assert done.scan.complete
    assert done.scan.progress.percent == 100.0
    assert line.judge.summary()["gap_violations"] == 0
    return done


def by_id(scan: Scan) -> dict[int, FoundDevice]:
    return {finding.slave: finding for finding in scan.found}


def found_ids(scan: Scan) -> list[int]:
    return [finding.slave for finding in scan.found]
