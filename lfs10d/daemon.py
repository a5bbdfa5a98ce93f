"""Builds everything, starts it in order and stops it in order. Knows everybody; decides nothing of the field.

The asyncio loop hosts MQTT, the station, requests and timers; the line thread owns the wire. What the line thread
hears comes here by one `call_soon_threadsafe` per exchange and goes through the station to the uplink.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import socket
import sys
import time
from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

from lfs10d import __version__, assembly, clock, logs
from lfs10d.changes import difference
from lfs10d.configfile import load
from lfs10d.errors import ConfigError
from lfs10d.facts import DaemonFacts, Instant
from lfs10d.linethread import LineThread
from lfs10d.modbus.bus import Bus
from lfs10d.modbus.port import SerialPort
from lfs10d.modbus.realtime import sharpen_timers, take_precedence
from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.mqtt.uplink import Uplink
from lfs10d.poller import Poller
from lfs10d.reading import Event, Exchanged, Fault, FaultCode, PortChanged
from lfs10d.requests.table import REQUESTS
from lfs10d.schedule import Schedule
from lfs10d.service import Service
from lfs10d.statedir import status_file
from lfs10d.station import Station
from lfs10d.statusfile import StatusFile
from lfs10d.supervision import Supervision
from lfs10d.systemd import Notifier

if TYPE_CHECKING:
    from collections.abc import Iterable

    from lfs10d.boot import Boot
    from lfs10d.config import Config
    from lfs10d.configfile import Loaded
    from lfs10d.secret import Secret
    from lfs10d.telemetry import Publication

log = logging.getLogger(__name__)

SWITCH_INTERVAL = 1e-4
"""Seconds the interpreter lets one thread run on: at the default of 5 ms the line thread wakes up 5 ms late."""
LINE_STOPS_WITHIN = 0.8
"""How long the line thread is waited for at the end, in s."""
FEATURES = ("history",)


class Daemon:
    """One line, from the port to the broker. Built and run inside an asyncio loop."""

    def __init__(self, loaded: Loaded, boot: Boot, notifier: Notifier) -> None:
        config = loaded.config
        self._loaded = loaded
        self._config = config
        self._notifier = notifier
        self._loop = asyncio.get_running_loop()
        self._over = asyncio.Event()
        self._failure: BaseException | None = None
        self._inbox: deque[list[Event]] = deque()
        self._clock: clock.ClockState = "unknown"
        self._ready = False
        self._ticking: asyncio.TimerHandle | None = None
        self._facts = DaemonFacts(
            version=__version__,
            host=socket.gethostname(),
            boot=boot.id,
            previous_boot=boot.previous,
            config_hash=assembly.config_hash(config),
            mqtt={"version": config.mqtt.version},
            features=FEATURES,
        )
        self._station = Station(
            self._facts,
            assembly.line_facts(config.line),
            assembly.device_facts(config, loaded.profiles),
            self._now(),
            backlog=lambda: self._uplink.backlog,
        )
        self._uplink = Uplink(
            self._broker_settings(config),
            base=f"{config.mqtt.base_topic}/{config.line.name}",
            line=config.line.name,
            burst=lambda: self._station.burst(self._now()),
            stands_behind=self._station.topics,
            requested=lambda request: self._service.requested(request),  # noqa: PLW0108 - built below
            epoch_ms=lambda: self._now().ts(),
            changed=self._uplink_changed,
        )
        self._service = Service(
            REQUESTS,
            self,
            allowed=frozenset(config.commands),
            respond=self._uplink.respond,
            clear=self._uplink.clear_retained,
        )
        self._port = SerialPort(assembly.port_settings(config.line))
        bus = Bus(self._port, assembly.line_rules(config.line), time.monotonic)
        schedule = Schedule(assembly.line_timing(config.line), time.monotonic())
        specs = assembly.device_specs(config, loaded.profiles)
        schedule.replace(specs, assembly.poll_rules(config.poll), time.monotonic())
        self._poller = Poller(bus, schedule, self._from_line, time.monotonic)
        self._line = LineThread(self._poller, prepare=self._prepare_line, failed=self._line_failed)
        file = status_file(config.line.name, os.environ)
        self._supervision = Supervision(
            notifier,
            None if file is None else StatusFile(file),
            declared=lambda: self._line.declared,
            snapshot=self.health,
            summary=self._summary,
        )

    def _broker_settings(self, config: Config) -> BrokerSettings:
        return BrokerSettings.of(config.mqtt, client_id=config.mqtt.client_id or "", password=self._password)

    def _password(self) -> Secret | None:
        return self._loaded.password()

    def _now(self) -> Instant:
        return Instant(time.monotonic(), time.time(), self._clock)

    async def run(self) -> int:
        """Measure and publish until SIGTERM or SIGINT; return the exit code."""
        for number in (signal.SIGTERM, signal.SIGINT):
            self._loop.add_signal_handler(number, self._over.set)
        self._loop.add_signal_handler(signal.SIGHUP, self._hang_up)
        sys.setswitchinterval(SWITCH_INTERVAL)
        tasks = [
            asyncio.create_task(self._watch_clock(), name="clock"),
            asyncio.create_task(self._supervision.run(), name="supervision"),
        ]
        try:
            self._line.start()
            await self._uplink.start()
            self._tick()
            if not any(slave.enabled for slave in self._config.slaves):
                self._tell_ready()
            await self._over.wait()
        finally:
            self._notifier.stopping("stopping")
            self._line.stop()
            for task in tasks:
                task.cancel()
            await self._service.stop()
            await asyncio.to_thread(self._line.join, LINE_STOPS_WITHIN)
            await self._uplink.stop()
        return 0 if self._failure is None else 1

    # -- the line thread

    def _prepare_line(self) -> None:
        """Make the line's thread wake up on time; runs in it, before its first turn."""
        if not sharpen_timers():
            log.debug("the timer slack of the line's thread cannot be set: gaps are 50 us longer than need be")
        if self._config.line.realtime and (refusal := take_precedence()) is not None:
            log.warning("%s", refusal)

    def _from_line(self, events: list[Event]) -> None:
        """Take what was heard, in the line's thread, over to the loop."""
        self._inbox.append(events)
        with contextlib.suppress(RuntimeError):  # the loop is closed: we are ending
            self._loop.call_soon_threadsafe(self._heard)

    def _heard(self) -> None:
        while self._inbox:
            now = self._now()
            published: list[Publication] = []
            for event in self._inbox.popleft():
                self._log(event)
                published += self._station.heard(event, now)
            self._publish(published)
            if not self._ready:
                self._tell_ready()

    def _publish(self, publications: Iterable[Publication]) -> None:
        self._uplink.publish(publications)
        if self._ticking is not None and self._station.due() < self._ticking.when():
            self._tick()

    def _log(self, event: Event) -> None:
        if isinstance(event, PortChanged):
            if event.fault is not None:
                log.warning("%s; tried again until it is back", event.fault.message)
                return
            log.info("port %s is open", self._port.settings.path)
            for notice in self._port.notices:
                log.warning("%s", notice)
        elif isinstance(event, Exchanged) and log.isEnabledFor(logging.DEBUG):
            sent, heard = event.sent.hex(" "), event.heard.hex(" ") or "nothing"
            log.debug(
                "slave %d: sent %s, heard %s%s", event.slave, sent, heard, f": {event.fault}" if event.fault else ""
            )

    def _line_failed(self, error: BaseException) -> None:
        """End the daemon: the line's thread, in which this runs, ended by a mistake."""
        self._failure = error
        log.error("the line's thread ended: %s", error, exc_info=error)
        self._loop.call_soon_threadsafe(self._over.set)

    # -- time

    def _tick(self) -> None:
        """Publish what time alone makes known, and come back when more is due."""
        if self._ticking is not None:
            self._ticking.cancel()
        self._uplink.publish(self._station.tick(self._now()))
        self._ticking = self._loop.call_at(self._station.due(), self._tick)

    async def _watch_clock(self) -> None:
        while True:
            self._clock = await asyncio.to_thread(clock.look)
            await asyncio.sleep(clock.LOOK_AGAIN[self._clock])

    # -- the service manager

    def _tell_ready(self) -> None:
        self._ready = True
        self._notifier.ready(self._summary())

    def _summary(self) -> str:
        broker = "connected" if self._uplink.connected else "away"
        return f"{self._station.summary(self._now())}, broker {broker}"

    def _hang_up(self) -> None:
        self._notifier.reloading()
        task = self._loop.create_task(self._reload_by_signal(), name="reload")
        task.add_done_callback(lambda _: self._notifier.ready(self._summary()))

    async def _reload_by_signal(self) -> None:
        try:
            done = await self.reload()
        except ConfigError as error:
            for problem in error.problems:
                log.error("%s", problem)  # noqa: TRY400 - for a person; where in our code says nothing
            log.error("the configuration is not reloaded: the running one stays")  # noqa: TRY400
        else:
            log.info("reloaded: %s", ", ".join(done["applied"]) or "nothing changed")
            if done["restart_required"]:
                log.warning("takes effect at the next restart only: %s", ", ".join(done["restart_required"]))

    # -- the broker

    def _uplink_changed(self) -> None:
        version = self._uplink.version
        now = self._now()
        if version is not None:
            self._facts = replace(self._facts, mqtt={"version": str(version)})
            self._uplink.publish(self._station.introduce(self._facts, now))
        if self._uplink.duplicate:
            message = "another client has taken our client id; give every daemon an mqtt.client_id of its own"
            self._uplink.publish(self._station.line_failed(Fault(FaultCode.DUPLICATE_CLIENT, message), now))
        else:
            self._uplink.publish(self._station.line_recovered(FaultCode.DUPLICATE_CLIENT, now))

    # -- what requests may use

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
        origins = {key: str(origin) for key, origin in self._loaded.origins.items() if origin.kind != "default"}
        return {"config": self._config.model_dump(mode="json"), "origins": origins}

    async def reload(self) -> dict[str, list[str]]:
        """Read the files again and apply what changed; raises ConfigError and changes nothing if one is wrong."""
        loaded = await asyncio.to_thread(load, self._loaded.path)
        found = difference(self._config, loaded.config)
        before, config = self._config, found.target
        self._loaded, self._config = loaded, config
        if {"slaves", "poll", "line"} & found.sections:
            line = config.line
            if before.line != line:
                self._poller.reconfigure(assembly.port_settings(line), assembly.line_rules(line))
                self._poller.post(lambda _: self._prepare_line())
            self._poller.replace(assembly.device_specs(config, loaded.profiles), assembly.poll_rules(config.poll))
            self._line.wake()
            devices = assembly.device_facts(config, loaded.profiles)
            self._publish(self._station.configure(assembly.line_facts(line), devices, self._now()))
        self._service.allow(frozenset(config.commands))
        logs.install(config.log.level, config.log.format)
        self._facts = replace(self._facts, config_hash=assembly.config_hash(config))
        self._publish(self._station.introduce(self._facts, self._now()))
        await self._uplink.reload(self._broker_settings(config) if before.mqtt != config.mqtt else None)
        return {"applied": list(found.applied), "restart_required": list(found.restart_required)}


async def run(loaded: Loaded, boot: Boot) -> int:
    """Run the daemon of one configuration until it is told to end; return the exit code."""
    notifier = Notifier()
    try:
        return await Daemon(loaded, boot, notifier).run()
    finally:
        notifier.close()
