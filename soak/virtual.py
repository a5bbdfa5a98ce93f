"""The daemon in virtual time: from the poller to the uplink, between a simulated line and a broker in memory.

What the line thread and the asyncio loop do by turns in the daemon, they do here in one thread: whenever the loop has
nothing to do until its next timer, the line goes on, but no further than to the next thing it has to tell. So a run
can be repeated exactly.
"""

from __future__ import annotations

import asyncio
import selectors
from collections import Counter
from collections.abc import Callable, Iterable, Mapping

from lfs10d.config.models import Config
from lfs10d.daemon.settings import config_hash, device_infos, line_info
from lfs10d.line.budget import timing_of
from lfs10d.line.poller import Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.line.settings import device_specs, line_rules, poll_rules, port_settings
from lfs10d.modbus.bus import Bus
from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.mqtt.uplink import Uplink
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Event, Reading
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.wire import nanoseconds
from lfs10d.system.clock import Instant
from lfs10d.telemetry.first_burst import FirstBurst
from lfs10d.telemetry.info import DaemonInfo
from lfs10d.telemetry.publication import Publication
from lfs10d.telemetry.station import Station
from soak.brokerinmemory import BrokerInMemory
from tests.support.virtual_port import STANDSTILL, SimulatedPort, VirtualClock

EPOCH = 1_700_000_000
"""Wall clock at the virtual time 0, in s."""
FARTHEST = 3600.0
"""The line goes on by no more than this at a time, in s."""


class Waiting(selectors.SelectSelector):
    """Where the loop waits: there the line goes on. No descriptor is ever ready."""

    def __init__(self, advance: Callable[[float], None]) -> None:
        super().__init__()
        self._advance = advance

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Let the line go on for so long at most (s)."""
        if timeout is None or timeout > 0:
            self._advance(FARTHEST if timeout is None else timeout)
        return []


class VirtualLoop(asyncio.SelectorEventLoop):
    """An asyncio loop whose time is the line's."""

    def __init__(self, clock: VirtualClock, advance: Callable[[float], None]) -> None:
        super().__init__(Waiting(advance))
        self._clock = clock

    def time(self) -> float:
        """Return the virtual time (s)."""
        return self._clock.now


class Recorder(SimulatedPort):
    """A port that keeps what it handed over, with the time: what a master on this line could know at all."""

    @property
    def handed(self) -> list[tuple[float, bytes]]:
        """What was handed over, in order."""
        return self.__dict__.setdefault("_handed", [])  # type: ignore[no-any-return]  # set here alone

    unread = 0
    """Frames that were written while bytes lay unread."""

    def write(self, frame: bytes) -> None:
        """Send a frame as any port does."""
        self.unread += bool(self.waiting())
        super().write(frame)

    def read(self) -> bytes:
        """Read as any port does."""
        data = super().read()
        if data:
            self.handed.append((self.clock.now, data))
        return data


class DaemonInMemory:
    """One life of the daemon on a line, by a configuration; a context manager. Times are virtual seconds."""

    def __init__(
        self,
        line: SimulatedLine,
        config: Config,
        profiles: Mapping[str, Profile],
        *,
        boot: str,
        echo: bool = False,
        latency: float = 0.0,
    ) -> None:
        self.line = line
        self.clock = VirtualClock()
        self.loop = VirtualLoop(self.clock, self._advance)
        self.port = Recorder(line, self.clock, port_settings(config.line), echo=echo, latency=latency)
        self.readings: Counter[str] = Counter()
        """How many readings of each device the line told."""
        self.good: dict[str, float] = {}
        """When each device had its last good one."""
        self.broker = BrokerInMemory(self.loop)
        self._ticking: asyncio.TimerHandle | None = None
        self._told = False
        self.mistakes: list[str] = []
        """What ended by a mistake in the loop."""
        scheduler = Scheduler(timing_of(config.line), 0.0)
        scheduler.replace(device_specs(config, profiles), poll_rules(config.poll), 0.0)
        self.poller = Poller(
            Bus(self.port, line_rules(config.line), self.clock), scheduler, self._take_over, self.clock
        )
        facts = DaemonInfo("0", "soak", boot, None, config_hash(config))
        devices = device_infos(config, profiles)
        self._station = Station(facts, line_info(config.line), devices, self.now())
        settings = BrokerSettings.of(config.mqtt, client_id="soak", password=lambda: None)
        self._uplink = Uplink(
            settings,
            base=f"{config.mqtt.base_topic}/{config.line.name}",
            epoch_ms=lambda: self.now().ts(),
            connect=self.broker.connect(),
        )
        self._first_burst = FirstBurst(self._station.burst(self.now()))
        self.loop.set_exception_handler(lambda _, context: self.mistakes.append(repr(context)))
        self.loop.run_until_complete(self._begin())

    def now(self) -> Instant:
        """Return this moment on both clocks."""
        return Instant(self.clock.now, EPOCH + self.clock.now, "synced")

    def go(self, seconds: float) -> None:
        """Go on for so long."""
        self.loop.run_until_complete(asyncio.sleep(seconds))

    def settle(self) -> None:
        """End: let what waits for the broker go out, and close."""
        self.broker.come()
        self.go(90.0)  # the past is opened 10 s after the connect, which comes within 30 s
        self.port.close()
        self.loop.run_until_complete(self._uplink.stop())

    def close(self) -> None:
        """Leave nothing behind."""
        for task in asyncio.all_tasks(self.loop):
            task.cancel()
        self.loop.close()

    # -- the line, as its thread drives it

    def _advance(self, seconds: float) -> None:
        limit, turns = self.clock.now + seconds, 0
        while True:
            wait = self.poller.turn(self.clock.now)
            if self._told or self.clock.now >= limit:
                break
            before = self.clock.now
            until = max(min(wait.until, limit), before)
            earliest = min(wait.not_before, until)
            self.clock.now = max(self.port.arrival(until), earliest) if wait.listen else until
            self.line.advance(nanoseconds(self.clock.now))
            turns = turns + 1 if self.clock.now == before else 0
            if turns > STANDSTILL:
                raise RuntimeError(f"time stands still at {before} s: the turn is always due now")
        self._told = False

    def _take_over(self, events: list[Event]) -> None:
        self._told = True
        self.loop.call_soon(self._heard, events)

    # -- the loop, as in `lfs10d.daemon.daemon`

    async def _begin(self) -> None:
        await self._uplink.start(self, on_request=lambda _: None, on_spool_trouble=lambda _: None)
        self._tick()

    def _heard(self, events: list[Event]) -> None:
        now = self.now()
        published: list[Publication] = []
        for event in events:
            if isinstance(event, Reading):
                self.readings[event.device] += 1
                if event.fault is None:
                    self.good[event.device] = event.at
            published += self._station.on_event(event, now)
        self._publish(published)

    def _publish(self, publications: Iterable[Publication]) -> None:
        self._uplink.publish(self._first_burst.passing(publications))
        if self._ticking is not None and self._station.due() < self._ticking.when():
            self._tick()

    def _tick(self) -> None:
        if self._ticking is not None:
            self._ticking.cancel()
        self._uplink.publish(self._first_burst.passing(self._station.tick(self.now(), self._uplink.backlog)))
        self._ticking = self.loop.call_at(self._station.due(), self._tick)

    # -- the uplink's events

    def burst(self) -> list[Publication]:
        """Return every retained topic."""
        return self._first_burst.burst(self._station.burst(self.now(), self._uplink.backlog))

    def topics(self) -> frozenset[str]:
        """Return the retained topics."""
        return self._station.topics()

    def on_uplink_change(self) -> None:
        """Take nothing."""

    def on_announced(self) -> None:
        """Publish what was held back for the first burst."""
        self._uplink.publish(self._first_burst.settle(self._station.burst(self.now())))
