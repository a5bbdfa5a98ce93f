"""The line for handlers: register access, ping, scan, pause, trace, polls on request."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Callable, Iterable
from functools import partial
from math import inf
from typing import TypeVar

from lfs10d.command import RefusedError
from lfs10d.commands.pause import FREED, LinePause
from lfs10d.commands.reads import PendingReads, ReadResult, altered
from lfs10d.commands.scanner import Scanner
from lfs10d.commands.trace import FrameTrace, TracedDevice
from lfs10d.config.live_config import LiveConfig
from lfs10d.config.models import Config, SlaveConfig
from lfs10d.line import settings
from lfs10d.line.jobs.job import Job
from lfs10d.line.jobs.ping import Ping
from lfs10d.line.jobs.register_access import Access, Target
from lfs10d.line.jobs.scan import Scan
from lfs10d.line.line import Line
from lfs10d.modbus.request import Request as RegisterRequest
from lfs10d.mqtt.publisher import Publisher
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Exchanged, Reading
from lfs10d.reconfiguration.reconfiguration import Reconfiguration
from lfs10d.system.clock import Instant
from lfs10d.system.threads import ThreadFuture, run_in_thread
from lfs10d.telemetry.publication import Publication

J = TypeVar("J", bound=Job)


class LineAccess:
    """Used in the thread of the asyncio loop; what it submits runs in the line's.

    Handlers call what stands before `on_reading`.
    """

    def __init__(self, line: Line, config: LiveConfig, publisher: Publisher, reconfiguration: Reconfiguration) -> None:
        self._line = line
        self._config = config
        self._reconfiguration = reconfiguration
        self._reads = PendingReads(line.read)
        self._trace: FrameTrace | None = None
        self._accesses: defaultdict[int, asyncio.Lock] = defaultdict(asyncio.Lock)
        self._scanner = Scanner(line, publisher)
        self._pause = LinePause(line, publisher)

    @property
    def paused(self) -> bool:
        """Whether the port is freed for another program."""
        return self._pause.paused

    async def read(self, device: str) -> ReadResult | None:
        """Poll a configured device now; None if it was removed or replaced before the poll."""
        return await self._reads.read(device)

    def trace(self, duration: float) -> None:
        """Publish every frame for `duration` s from now on, in place of what was set before."""
        loaded = self._config.loaded
        specs = settings.device_specs(loaded.config, loaded.profiles)
        devices = {spec.slave: TracedDevice(spec.name, spec.codec, spec.profile) for spec in specs}
        until = asyncio.get_running_loop().time() + duration
        self._trace = FrameTrace(until, devices, settings.usual_codec(loaded.config.line))
        self._line.hand_over_at_once(until)

    async def scan(self, ids: tuple[int, ...], rates: tuple[int, ...], share: float) -> Scan:
        """Search the line for devices, with at most that `share` of its time; return the scan that is over.

        No `rates` are the usual ones. Raises RefusedError while a change of sensors or another scan is under way.
        """
        if self.paused:
            raise RefusedError(FREED)
        with self._reconfiguration.place("line/scan"):
            loaded = self._config.loaded
            plan = await run_in_thread(partial(settings.scan_plan, loaded, ids, rates, share=share), "profiles")
            return await self._scanner.scan(plan)

    async def pause(self, duration: float) -> None:
        """Free the port for `duration` s from now on, in place of what was set before; return when it is free.

        Raises RefusedError while a change of sensors or a scan is under way.
        """
        if (busy := self._reconfiguration.busy) is not None:
            raise RefusedError(busy)
        await self._pause.pause(duration)

    def cancel(self) -> tuple[str, ...]:
        """End trace, scan and pause; return those that were under way: `trace`, `scan`, `pause`."""
        tracing = self._trace is not None and asyncio.get_running_loop().time() < self._trace.until
        self._trace = None
        self._line.hand_over_at_once(-inf)
        ended = {"trace": tracing, "scan": self._scanner.cancel(), "pause": self._pause.end()}
        return tuple(name for name, one in ended.items() if one)

    async def ping(self, slave: int, profile: Profile) -> Ping:
        """Ask a slave id that is not polled whether a device answers; return the job that is over."""
        codec = settings.profile_codec(self._config.now.config.line, profile)
        return await self._run(lambda over: Ping(slave, profile, codec, over))

    async def access(self, request: RegisterRequest, device: SlaveConfig | None) -> Access:
        """Read or write registers of a configured device, or of a slave that is not; return the job that is over."""
        target = settings.access_target(self._config.now.loaded, request.slave, device)
        async with self._accesses[request.slave]:  # one after the other: each reads back what it wrote itself
            return await self._run(partial(self._new_access, target, request))

    def _new_access(self, target: Target, request: RegisterRequest, over: Callable[[Access], None]) -> Access:
        line = self._line
        return Access(target, request, pending=line.pending, echo_known=line.echo_known, over=over)

    async def _run(self, job: Callable[[Callable[[J], None]], J]) -> J:
        """Submit the job that `build` makes with its callback; return it when it is over."""
        over: ThreadFuture[J] = ThreadFuture()
        self._line.submit(job(over.set_result))
        return await over

    # -- what happens on the line

    def on_reading(self, reading: Reading, published: Iterable[Publication]) -> None:
        """Take a reading with its publications."""
        if reading.requests:
            self._reads.on_reading(reading, published)

    def on_exchange(self, exchanged: Exchanged, now: Instant) -> list[Publication]:
        """Take an exchange; return the publications of a trace."""
        if self._trace is not None:
            if now.mono < self._trace.until:
                return self._trace.publications(exchanged, now)
            self._trace = None
        return []

    def on_config(self, before: Config, after: Config) -> None:
        """Take another configuration: reads of devices that were removed or replaced end without a reading."""
        self._reads.abandon(altered(_identities(before), _identities(after)))
        if before.line != after.line:
            self._scanner.cancel()  # it uses the settings of the line before


def _identities(config: Config) -> dict[str, object]:
    """Return slave id, profile and the like of each device: if they differ it is another device."""
    framing = config.line.framing
    return {slave.name: (slave.id, slave.profile, slave.checksum, slave.enabled, framing) for slave in config.slaves}
