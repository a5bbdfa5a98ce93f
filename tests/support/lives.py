"""Reconfiguration in virtual time: one life of a daemon after the other on one line."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, cast

from lfs10d.command import Command, Result
from lfs10d.commands.admission import Admission
from lfs10d.commands.context import Context, Handler
from lfs10d.commands.dispatcher import Dispatcher
from lfs10d.commands.handlers.registry import HANDLERS
from lfs10d.commands.responder import Responder
from lfs10d.config.changes_file import ChangesFile
from lfs10d.config.effective import Edit, Effective
from lfs10d.config.live_config import LiveConfig, News
from lfs10d.config.loader import load
from lfs10d.config.models import Config
from lfs10d.config.reload import ReloadPlan
from lfs10d.line.budget import timing_of
from lfs10d.line.jobs.job import Job
from lfs10d.line.jobs.procedure import Procedure
from lfs10d.line.poller import Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.line.settings import device_specs, line_rules, poll_rules, port_settings
from lfs10d.modbus.bus import Bus
from lfs10d.modbus.echo import Echo
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.mqtt.topics import InboundRequest
from lfs10d.reading import Event, PortChanged, Reading
from lfs10d.reconfiguration.journal import Journal
from lfs10d.reconfiguration.reconfiguration import Reconfiguration
from lfs10d.reconfiguration.runner import ChangeRunner
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from lfs10d.system.clock import Instant
from lfs10d.system.disk import Disk
from tests.support.virtual_loop import Loop
from tests.support.virtual_port import SimulatedPort, VirtualClock, run
from tests.support.volatile_disk import ForgetfulFiles, PowerCutError

T = TypeVar("T")
STATE = Path("/state")
CHANGING = ("device/readdress", "line/baudrate", "line/adopt")
"""The requests that physically change a sensor."""
STEP = 0.05
"""The line goes on by so much at a time, in s."""
EPOCH = 1_700_000_000.0


class Wire:
    """The line as physical changes see it, called in turns."""

    def __init__(self, poller: Poller) -> None:
        self.poller = poller

    @property
    def pending(self) -> PendingRequests:
        return self.poller.scheduler.pending

    def echo_known(self) -> bool:
        return self.poller.bus.echo is not Echo.UNKNOWN

    def submit(self, job: Job) -> None:
        self.poller.submit(job)

    def resume_procedure(self, procedure: Procedure, result: object) -> None:
        def tell(now: float) -> None:
            procedure.resume(result)
            self.poller.scheduler.wake(procedure, now)

        self.poller.post(tell)

    def hand_over_at_once(self, until: float) -> None:
        self.poller.hand_over.at_once_until = until


class Unpaused:
    """A line that is never freed for another program."""

    paused = False


@dataclass
class Life:
    """One life of the daemon."""

    bench: Bench
    running: LiveConfig = field(init=False)
    poller: Poller = field(init=False)
    physical: Reconfiguration = field(init=False)
    events: list[tuple[str, Mapping[str, object]]] = field(default_factory=list)
    readings: list[Reading] = field(default_factory=list)
    news: list[News] = field(default_factory=list)
    service: Dispatcher = field(init=False)

    def __post_init__(self) -> None:
        bench = self.bench
        disk = Disk(bench.files)
        self.running = LiveConfig(load(bench.file), ChangesFile(STATE, disk))
        handlers = self.handlers
        specs = {name: handler.spec for name, handler in handlers.items()}
        responder = Responder(Admission(specs, frozenset({"polling", "sensors", "registers"})), bench)
        runner = ChangeRunner(
            Journal(STATE, disk),
            running=lambda: self.running.now,
            change=self._change,
            learn=self.running.learn,
            wire=lambda: Wire(self.poller),
            announce=lambda kind, facts: self.events.append((kind, facts)),
            recall=responder.recall,
            now=lambda: Instant(bench.clock.now, EPOCH + bench.clock.now, "synced"),
        )
        self.physical = Reconfiguration(
            runner,
            act=lambda activity: self.events.append(("acting", {"activity": activity})),
            repoll=self._repoll,
        )
        config, profiles = self.physical.polled(), self.running.loaded.profiles
        bench.port = SimulatedPort(
            bench.line, bench.clock, port_settings(config.line), echo=bench.echo, latency=bench.latency
        )
        bus = Bus(bench.port, line_rules(config.line), bench.clock)
        scheduler = Scheduler(timing_of(config.line), bench.clock.now)
        scheduler.replace(
            device_specs(config, profiles), poll_rules(config.poll), bench.clock.now
        )  # fmt: skip
        self.poller = Poller(bus, scheduler, self._heard, bench.clock)
        self.running.start(self)
        self.service = Dispatcher(handlers, self.context(), responder)
        self.physical.recall()

    @property
    def handlers(self) -> Mapping[str, Handler]:
        """The handlers of the requests that this life knows."""
        return {name: HANDLERS[name] for name in CHANGING}

    def context(self) -> Context:
        """Return what the handlers may use."""
        return Context(self.running, cast("Any", Unpaused()), self.physical, cast("Any", None))

    def report(self, news: News) -> None:
        """Take what became of changes."""
        self.news.append(news)

    def request(self, name: str, **parameters: Any) -> None:  # noqa: ANN401 - any JSON
        """Let a request come in by MQTT; its response comes to `bench.responses`."""

        async def come() -> None:
            payload = json.dumps(parameters).encode()
            topic = f"lfs10d/line0/request/{name}"
            self.service.on_request(InboundRequest(topic, tuple(name.split("/")), payload, retained=False))

        self.bench.loop.run_until_complete(come())

    def end(self) -> None:
        """End as on SIGTERM, in the daemon's order."""

        async def ended() -> None:
            await self.physical.stop()
            await self.service.stop()

        self.bench.loop.run_until_complete(ended())

    async def apply(self, plan: ReloadPlan, before: Effective) -> None:
        now = self.running.now
        if plan.line:
            self.poller.reconfigure(port_settings(now.config.line), line_rules(now.config.line))
        self.poller.replace(
            device_specs(self.physical.polled(), now.loaded.profiles), poll_rules(now.config.poll)
        )  # fmt: skip
        await self.physical.reconfigured(before.config, now.config)

    def _repoll(self, polled: Config) -> None:
        now = self.running.now
        self.poller.replace(device_specs(polled, now.loaded.profiles), poll_rules(now.config.poll))

    async def _change(self, edit: Edit) -> object:
        return await self.running.change(edit)

    def _heard(self, events: list[Event]) -> None:
        self.readings += [event for event in events if isinstance(event, Reading)]
        if any(isinstance(event, PortChanged) and event.fault is None for event in events):
            self.bench.loop.call_soon(self.physical.follow)

    def place(self, device: str) -> int:
        """Return where the configuration has a device."""
        slave = self.running.now.slave(device)
        assert slave is not None
        return slave.id

    def told(self, kind: str) -> list[Mapping[str, object]]:
        """Return the events of a kind."""
        return [facts for each, facts in self.events if each == kind]


class Bench:
    """A line with sensors, a file, a disk; one daemon after the other."""

    def __init__(self, folder: Path, loop: Loop) -> None:
        self.loop = loop
        self.file = folder / "lfs10d.yaml"
        self.renew()

    def renew(self) -> None:
        """Begin with a new line and an empty disk."""
        for task in asyncio.all_tasks(self.loop):
            task.cancel()
        self.pump()
        self.clock = self.loop.clock = VirtualClock()
        self.files = ForgetfulFiles()
        self.cleared: list[str] = []
        self.responses: list[dict[str, Any]] = []
        """To requests that came in by MQTT, in all lives."""
        self.line = SimulatedLine()
        self.port = SimulatedPort(self.line, self.clock, PortSettings("/dev/simulated", 9600))
        self.echo = False
        self.latency = 0.0
        """How long the adapter holds back what it received, at most, in s."""
        self.dark = False

    def sensors(
        self,
        *slaves: int,
        names: bool = True,
        baudrate: int = 9600,
        poll: str = "{interval: 1s}",
        echo: bool = False,
        latency: float = 0.0,
    ) -> Life:
        """Put sensors on the line, configure them as `s<id>`, and begin a life."""
        self.echo, self.latency = echo, latency
        self.line = SimulatedLine([Sensor(slave, format=Format(baudrate)) for slave in slaves], format=Format(baudrate))
        entries = ", ".join(f"{{id: {slave}, name: s{slave}}}" for slave in slaves) if names else ""
        self.file.write_text(
            f"line: {{port: /dev/simulated, baudrate: {baudrate}}}\npoll: {poll}\nslaves: [{entries}]\n"
            "mqtt: {host: localhost}\n"
        )
        return self.begin()

    def begin(self) -> Life:
        """Begin a life with what is on the disk; `born` is when, in ns."""
        self.born = round(self.clock.now * 1e9)

        async def born() -> Life:
            return Life(self)

        return self.loop.run_until_complete(born())

    def go(self, life: Life, seconds: float) -> None:
        """Let the line and the loop go on, in turns."""
        until = self.clock.now + seconds
        while self.clock.now < until:
            self.turn(life)

    def turn(self, life: Life) -> None:
        """Let the line go on a little, and then the loop."""
        self.port.line = self.line
        run(life.poller.turn, self.port, self.clock, self.clock.now + STEP)
        self.pump()

    def pump(self) -> None:
        """Let the loop do what can be done now."""
        self.loop.drain()

    def clear_retained(self, topic: str) -> None:
        """Take that a retained request is cleared."""
        self.cleared.append(topic)

    def respond(self, topic: str, response: dict[str, object], correlation: bytes | None = None) -> None:
        """Take a response."""
        del topic, correlation
        if self.dark:
            return
        error = response["error"]
        if isinstance(error, dict) and error["code"] == "internal":
            assert self.files.steps_left is not None, response
            return  # it is the power that failed: nobody is there any more
        self.responses.append(response)

    def ask(self, life: Life, coroutine: Awaitable[Result], *, within: float = 120.0) -> Result:
        """Let everything go on until a request is answered."""
        task = asyncio.ensure_future(coroutine, loop=self.loop)
        until = self.clock.now + within
        while not task.done():
            assert self.clock.now < until, f"no answer within {within} s"
            self.turn(life)
        return task.result()

    def readdress(self, life: Life, device: str, to: int, *, dry_run: bool = False, id: str = "a1") -> Result:  # noqa: A002 - the request's own word
        """Ask for another slave id and wait for the answer."""
        return self.ask(life, life.physical.readdress(device, to, dry_run=dry_run, call=Command(id)))

    def cut(self, *surviving: Path) -> None:
        """Cut the gateway's power: everything that ran is gone, and of the files what was not synced."""
        self.files.steps_left = 0  # nothing more comes onto this disk
        self.dark = True  # nor to the broker
        while tasks := asyncio.all_tasks(self.loop):  # what is cancelled may begin another
            for task in tasks:
                task.cancel()
            self.pump()
        self.dark = False
        self.files.power_cut(surviving)
        self.port.close()


def _mistake(_: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    assert isinstance(context.get("exception"), PowerCutError), context
