"""What the daemon lets requests do."""

from __future__ import annotations

import asyncio
import contextlib
from collections import defaultdict
from collections.abc import Awaitable, Callable, Iterable, Mapping
from functools import partial
from typing import TypeVar

from lfs10d.command import Command, RefusedError, Result, rejected
from lfs10d.commands.pause import LinePause
from lfs10d.commands.reads import PendingReads, ReadResult, altered
from lfs10d.commands.scanner import Scanner
from lfs10d.commands.trace import FrameTrace, TracedDevice
from lfs10d.config.effective import Effective
from lfs10d.config.live_config import Edit, LiveConfig
from lfs10d.config.models import Config, SlaveConfig
from lfs10d.config.reload import ReloadPlan
from lfs10d.line import settings
from lfs10d.line.jobs.job import Job
from lfs10d.line.jobs.ping import Ping
from lfs10d.line.jobs.register_access import Access
from lfs10d.line.jobs.scan import Scan
from lfs10d.line.line import Line
from lfs10d.modbus.echo import Echo
from lfs10d.modbus.request import Request as RegisterRequest
from lfs10d.mqtt.uplink import Uplink
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Event, Exchanged, Reading
from lfs10d.reconfiguration.adopt import AdoptRequest
from lfs10d.reconfiguration.reconfiguration import Reconfiguration
from lfs10d.system.clock import Instant
from lfs10d.system.threads import run_in_thread
from lfs10d.telemetry.line_state import PAUSED, POLLING
from lfs10d.telemetry.publication import Publication, event
from lfs10d.telemetry.station import Station

J = TypeVar("J", bound=Job)


class LineAccess:
    """`Powers` of `lfs10d.commands.context` on a running daemon.

    `now` gives the moment, `running` has the configuration that holds, `reload` takes up the files as they are,
    `change` what a request wants; `line()` is the line, `publish` tells the broker.
    """

    def __init__(
        self,
        station: Station,
        uplink: Uplink,
        *,
        now: Callable[[], Instant],
        running: LiveConfig,
        reload: Callable[[], Awaitable[ReloadPlan]],
        change: Callable[[Edit], Awaitable[tuple[Effective, Effective]]],
        line: Callable[[], Line],
        publish: Callable[[list[Publication]], None],
    ) -> None:
        self._station = station
        self._uplink = uplink
        self._now = now
        self._running = running
        self._reload = reload
        self._change = change
        self._line = line
        self._publish = publish
        self.physical: Reconfiguration | None = None
        """What changes sensors; given later, for it needs us."""
        self._inquiries = PendingReads(lambda device, request: line().read(device, request))
        self._trace: FrameTrace | None = None
        self._accesses: defaultdict[int, asyncio.Lock] = defaultdict(asyncio.Lock)
        self._scanning = Scanner(submit=lambda job: line().submit(job), act=self.act, tell=self.tell)
        self._pausing = LinePause(pause=lambda: line().pause(), resume=lambda: line().resume(), act=self.act)

    def health(self) -> dict[str, object]:
        """Return how the daemon, the line and the devices are."""
        backlog = self._uplink.backlog
        return {
            **self._station.snapshot(self._now()),
            "broker": {"connected": self._uplink.connected, "depth": backlog.depth, "dropped": backlog.dropped},
        }

    def republish(self) -> int:
        """Send every retained topic once more; return how many."""
        self._uplink.republish()
        return len(self._station.topics()) + 1

    def configuration(self) -> dict[str, object]:
        """Return the effective configuration and where what is no default comes from."""
        loaded = self._running.loaded
        origins = {key: str(origin) for key, origin in loaded.origins.items() if origin.kind != "default"}
        return {"config": loaded.config.model_dump(mode="json"), "origins": origins}

    async def reload(self) -> dict[str, list[str]]:
        """Read the files again and apply what changed; raises ConfigError and changes nothing if one is wrong."""
        done = await self._reload()
        return {"applied": list(done.applied), "restart_required": list(done.restart_required)}

    def devices(self) -> tuple[str, ...]:
        """Return the names of the configured devices."""
        return tuple(slave.name for slave in self._running.now.config.slaves)

    async def read(self, device: str) -> ReadResult | None:
        """Poll a device now."""
        return await self._inquiries.read(device)

    def trace(self, duration: float) -> None:
        """Tell every frame for `duration` s from now on."""
        loaded = self._running.loaded
        specs = settings.device_specs(loaded.config, loaded.profiles)
        devices = {spec.slave: TracedDevice(spec.name, spec.codec, spec.profile) for spec in specs}
        until = self._now().mono + duration
        self._trace = FrameTrace(until, devices, settings.usual_codec(loaded.config.line))

    async def scan(self, ids: tuple[int, ...], rates: tuple[int, ...], share: float) -> Scan:
        """Find out who is on the line."""
        if self._pausing.paused:
            raise RefusedError(rejected("line_error", "the port is freed for another program; see line/cancel"))
        with self._place("line/scan"):
            loaded = self._running.loaded
            search = await run_in_thread(partial(settings.search, loaded, ids, rates, share=share), "profiles")
            return await self._scanning.scan(search)

    async def pause(self, duration: float) -> None:
        """Free the port for another program."""
        busy = None if self.physical is None else self.physical.busy
        if busy is not None:
            raise RefusedError(busy)
        await self._pausing.pause(duration)

    def _place(self, request: str) -> contextlib.AbstractContextManager[None]:
        if self.physical is None:
            raise RefusedError(rejected("busy", "the daemon is starting"))
        return self.physical.place(request)

    def cancel(self) -> tuple[str, ...]:
        """End the trace, the scan and the pause."""
        tracing = self._trace is not None and self._now().mono < self._trace.until
        self._trace = None
        ended = {"trace": tracing, "scan": self._scanning.cancel(), "pause": self._pausing.end()}
        return tuple(name for name, one in ended.items() if one)

    def effective(self) -> Effective:
        """Return the configuration that holds."""
        return self._running.now

    async def change(self, edit: Edit) -> tuple[Effective, Effective]:
        """Change what holds."""
        return await self._change(edit)

    def applied(self, request: str, call: Command, **facts: object) -> None:
        """Tell on `event` what a request changed."""
        self._publish([event("change_applied", self._now().ts(), request=request, id=call.key, **facts)])

    def tell(self, kind: str, facts: Mapping[str, object]) -> None:
        """Tell everybody on `event`."""
        self._publish([event(kind, self._now().ts(), **facts)])

    def act(self, activity: str | None) -> None:
        """Tell everybody what the line is busy with; None: with polling. While it is paused, nothing else is it."""
        if self._pausing.paused and activity != PAUSED:
            return
        self._publish(self._station.on_activity(activity or POLLING, self._now()))

    async def baudrate(self, to: int, *, power_cycle: bool, dry_run: bool, call: Command) -> Result:
        """Move every sensor and the port to another rate."""
        if self._pausing.paused:
            return rejected("line_error", "the port is freed for another program; see line/cancel")
        if self.physical is None:
            return rejected("busy", "the daemon is starting")
        return await self.physical.baudrate(to, power_cycle=power_cycle, dry_run=dry_run, call=call)

    async def adopt(
        self, *, name: str | None, label: str | None, profile: str, factory: int | None, to: int | None, call: Command
    ) -> Result:
        """Take in a factory-new sensor."""
        if self.physical is None:
            return rejected("busy", "the daemon is starting")
        return await self.physical.adopt(AdoptRequest(name, label, factory, to, profile), call)

    async def knock(self, slave: int, profile: Profile) -> Ping:
        """Ask one slave id whether anybody is there."""
        codec = settings.profile_codec(self._running.now.config.line, profile)
        return await self._carry_out(lambda over: Ping(slave, profile, codec, over))

    async def access(self, what: RegisterRequest, device: SlaveConfig | None) -> Access:
        """Read or write registers."""
        target = settings.access_target(self._running.now.loaded, what.slave, device)
        poller = self._line().poller
        async with self._accesses[what.slave]:  # one after the other: what one writes is not read back by another
            return await self._carry_out(
                lambda over: Access(
                    target,
                    what,
                    pending=poller.scheduler.pending,
                    echo_known=lambda: poller.bus.echo is not Echo.UNKNOWN,
                    over=over,
                )
            )

    async def _carry_out(self, job: Callable[[Callable[[J], None]], J]) -> J:
        """Have a job done that tells when it is over, in the line's thread; return it then."""
        loop = asyncio.get_running_loop()
        over: asyncio.Future[J] = loop.create_future()

        def settle(done: J) -> None:
            if not over.done():
                over.set_result(done)

        def tell(done: J) -> None:
            with contextlib.suppress(RuntimeError):  # the loop is closed: nobody waits any more
                loop.call_soon_threadsafe(settle, done)

        self._line().submit(job(tell))
        return await over

    def reserved(self) -> Mapping[int, str]:
        """Return the slave ids that no device may be given now, with the reason."""
        return {} if self.physical is None else self.physical.reserved()

    async def readdress(self, device: str, to: int, *, dry_run: bool, call: Command) -> Result:
        """Give a sensor another slave id."""
        if self.physical is None:
            return rejected("busy", "the daemon is starting")
        return await self.physical.readdress(device, to, dry_run=dry_run, call=call)

    # -- what they need to know of the line

    def heard(self, happened: Event, published: Iterable[Publication], now: Instant) -> list[Publication]:
        """Take an event of the line thread with what the station made of it; return what is told besides."""
        if isinstance(happened, Reading):
            self._inquiries.heard(happened, published)
        elif isinstance(happened, Exchanged) and self._trace is not None:
            if now.mono < self._trace.until:
                return self._trace.told(happened, now)
            self._trace = None
        return []

    def reconfigured(self, before: Config, after: Config) -> None:
        """Take note of another configuration: polls of devices that are no longer the same have no reading."""
        self._inquiries.abandon(altered(_identities(before), _identities(after)))
        if before.line != after.line:
            self._scanning.cancel()  # it speaks as the line did before


def _identities(config: Config) -> dict[str, object]:
    """Return what makes each device this one and no other on the line."""
    framing = config.line.framing
    return {slave.name: (slave.id, slave.profile, slave.checksum, slave.enabled, framing) for slave in config.slaves}
