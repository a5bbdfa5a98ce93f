"""Access to registers on a simulated line in virtual time."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.jobs.register_access import Access, Target
from lfs10d.line.poller import Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.modbus.bus import Bus, LineRules
from lfs10d.modbus.echo import Echo
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.request import ReadRegisters, Request
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Event, Exchanged, Purpose
from lfs10d.simulator.blueprint import blueprint_of
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from tests.support.simulated import violations
from tests.support.virtual_port import SimulatedPort, VirtualClock, run

ROOT = Path(__file__).parents[2]
VANE = load_profile("config/profiles/wind-vane.yaml", relative_to=ROOT)
RTU = Codec(Framing.RTU)
AVERAGING = 0x0010
LONGEST = 60.0
"""Virtual seconds after which an access counts as endless."""


@dataclass
class Rig:
    """A line with a wind vane at id 7, which has one setting, 1 to 60 at 0x0010; `polled` if a poller asks it too."""

    echo: Literal["auto", "on", "off"] = "off"
    adapter_echoes: bool = False
    polled: bool = False
    ended: list[Access] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    clock: VirtualClock = field(default_factory=VirtualClock)

    def __post_init__(self) -> None:
        self.vane = Sensor(7, blueprint=blueprint_of(VANE))
        self.line = SimulatedLine([self.vane], seed=1)
        self.port = SimulatedPort(self.line, self.clock, PortSettings("/dev/sim"), echo=self.adapter_echoes)
        self.bus = Bus(self.port, LineRules(echo=self.echo), self.clock)
        self.scheduler = Scheduler(self.bus.line_timing, 0.0)
        self.poller = Poller(self.bus, self.scheduler, self.events.extend, self.clock)
        if self.polled:
            self.poller.replace([DeviceSpec("vane", 7, VANE, RTU, 0.25)], PollRules())

    def begin(self, what: Request, profile: Profile | None = VANE, timeout: float | None = None) -> Access:
        access = Access(
            Target(what.slave, RTU, profile, timeout),
            what,
            pending=self.scheduler.pending,
            echo_known=lambda: self.bus.echo is not Echo.UNKNOWN,
            over=self.ended.append,
        )
        self.poller.submit(access)
        return access

    def pass_time(self, seconds: float) -> None:
        run(self.poller.turn, self.port, self.clock, self.clock.now + seconds)

    def do(self, what: Request, profile: Profile | None = VANE, timeout: float | None = None) -> Access:
        """Have it done; it is told once that it is over, and the judge of the line has nothing to say."""
        access = self.begin(what, profile, timeout)
        while access.end is None:
            assert self.clock.now < LONGEST, "the access does not end"
            self.pass_time(0.05)
        assert self.ended.count(access) == 1
        assert violations(self.line.judge) == 0
        return access

    @property
    def asked(self) -> list[bytes]:
        """What the access asked, without slave id and check."""
        return [each.sent[1:-2] for each in self.exchanges]

    @property
    def exchanges(self) -> list[Exchanged]:
        return [each for each in self.events if isinstance(each, Exchanged) and each.purpose is Purpose.REQUEST]

    @property
    def writes(self) -> list[bytes]:
        return [each for each in self.asked if each[:1] == b"\x06"]


def read(address: int = AVERAGING, count: int = 1, slave: int = 7) -> ReadRegisters:
    return ReadRegisters(slave, address, count)
