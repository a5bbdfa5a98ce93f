"""A whole line in virtual time: poller, bus and simulated sensors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from lfs10d.line.device import DeviceSpec, PollRules
from lfs10d.line.poller import Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.modbus.bus import Bus, LineRules, Wait
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Event, Exchanged, FaultCode, PortChanged, Reading
from lfs10d.simulator.burst import MASTER
from lfs10d.simulator.judge import HeardRequest
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Reply, Sensor
from lfs10d.simulator.wire import Format
from tests.support.queued_sensor import QueuedSensor
from tests.support.virtual_port import SimulatedPort, VirtualClock, run

LFS10 = load_profile("lfs10", relative_to=Path())


NAMES = {slave: f"slave-{slave}" for slave in range(256)}


def a_spec(
    slave: int,
    interval: float = 1.0,
    *,
    name: str | None = None,
    enabled: bool = True,
    response_timeout: float | None = None,
    profile: Profile = LFS10,
) -> DeviceSpec:
    codec = Codec(Framing.RTU)
    return DeviceSpec(name or NAMES[slave], slave, profile, codec, interval, enabled, response_timeout)


@dataclass
class Rig:
    """One line and its poller. `events` is all that the poller told."""

    line: SimulatedLine
    clock: VirtualClock
    port: SimulatedPort
    poller: Poller
    events: list[Event] = field(default_factory=list)
    turns: int = 0

    def run(self, until: float) -> Rig:
        """Let the line go on until that time has come."""
        run(self._turn, self.port, self.clock, until)
        return self

    def _turn(self, now: float) -> Wait:
        self.turns += 1
        return self.poller.turn(now)

    @property
    def readings(self) -> list[Reading]:
        return [event for event in self.events if isinstance(event, Reading)]

    @property
    def exchanges(self) -> list[Exchanged]:
        return [event for event in self.events if isinstance(event, Exchanged)]

    @property
    def port_changes(self) -> list[PortChanged]:
        return [event for event in self.events if isinstance(event, PortChanged)]

    def of(self, slave: int, *, since: float = 0.0) -> list[Reading]:
        return [reading for reading in self.readings if reading.device == NAMES[slave] and reading.at >= since]

    def good(self, slave: int, *, since: float = 0.0) -> list[Reading]:
        return [reading for reading in self.of(slave, since=since) if reading.fault is None]

    def codes(self, slave: int, *, since: float = 0.0) -> Counter[FaultCode]:
        return Counter(reading.fault.code for reading in self.of(slave, since=since) if reading.fault)

    @property
    def sent(self) -> int:
        """How many requests of ours the line heard."""
        return sum(request.speaker is MASTER for request in self.line.log)

    def prove(self) -> Rig:
        """Hold every value to what the line itself knows: the answer to the very request it was read by.

        And no request of ours began before its silence was over, or was torn.
        """
        ours = {request.begun: request for request in self.line.log if request.speaker is MASTER}
        seen: set[float] = set()
        for reading in self.readings:
            assert (reading.values is None) is (reading.fault is not None)
            if reading.values is None:
                assert reading.rtt is None
                continue
            assert reading.rtt is not None
            request = _nearest(ours, reading.at - reading.rtt)
            answers = [answer for answer in request.answers if _is_ours(answer, request)]
            assert reading.values["wind_speed"] in [answer.values[0] for answer in answers]
            assert NAMES[request.body[0]] == reading.device
            assert reading.values["wind_speed"] not in seen
            seen.add(float(reading.values["wind_speed"]))
        judge = self.line.judge
        assert judge.counts["torn"] == 0
        if not self.port.adapter.latency:  # else what an adapter still holds back cannot be known
            assert judge.counts["gap"] == 0
        heard = sum(len(exchange.heard) + exchange.unsolicited for exchange in self.exchanges)
        assert self.turns <= 12 * len(self.exchanges) + heard + 20 * self.clock.now + 100  # no busy loop
        return self


def _nearest(requests: dict[int, HeardRequest], when: float) -> HeardRequest:
    begun = round(when * 1e9)
    for shift in range(2001):  # floats of a long run
        for near in (begun - shift, begun + shift):
            if near in requests:
                return requests[near]
    raise AssertionError(f"no request was begun at {when}")


def _is_ours(answer: Reply, request: HeardRequest) -> bool:
    return bool(answer.values) and answer.sensor.slave == request.body[0] and not answer.second


class Rigs:
    """Builds rigs and what they poll; the fixture `rigs` gives one."""

    spec = staticmethod(a_spec)

    def __call__(  # noqa: PLR0913 - a line has many sides, each with its default
        self,
        slaves: int | Iterable[int] = 4,
        *,
        polled: Sequence[DeviceSpec] | None = None,
        interval: float = 0.0,
        response_timeout: float | None = None,
        rules: PollRules | None = None,
        line_rules: LineRules | None = None,
        baudrate: int = 9600,
        turnaround: float = 0.005,
        jitter: float = 0.0,
        echo: bool = False,
        latency: float = 0.0,
        seed: int = 0,
        started: float = 0.0,
        in_turn: bool = False,
    ) -> Rig:
        """Return a line with sensors at `slaves` (or 1 to that many), all of them polled unless `polled` says whom."""
        ids = range(1, slaves + 1) if isinstance(slaves, int) else tuple(slaves)
        shape = Format(baudrate)
        kind = QueuedSensor if in_turn else Sensor
        sensors = [kind(slave, format=shape, turnaround=turnaround, jitter=jitter, seed=seed) for slave in ids]
        line = SimulatedLine(sensors, format=shape, seed=seed)
        clock = VirtualClock(started)
        port = SimulatedPort(line, clock, PortSettings("/dev/simulated", baudrate), echo=echo, latency=latency)
        bus = Bus(port, line_rules or LineRules(), clock)
        scheduler = Scheduler(LineTiming.of(baudrate), started)
        if polled is None:
            polled = [a_spec(slave, interval, response_timeout=response_timeout) for slave in ids]
        scheduler.replace(polled, rules or PollRules(), started)
        events: list[Event] = []
        return Rig(line, clock, port, Poller(bus, scheduler, events.extend, clock), events)
