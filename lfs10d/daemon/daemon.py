"""Builds everything, starts it in order and stops it in order. Knows everybody; decides nothing of the field.

The asyncio loop hosts MQTT, the station, requests and timers; the line thread owns the wire. What the line thread
hears comes here by one `call_soon_threadsafe` per exchange and goes through the station to the uplink.
"""

from __future__ import annotations

import asyncio
import logging
import os
import socket
import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from math import inf
from pathlib import Path

from lfs10d import __version__
from lfs10d.commands.dispatcher import Dispatcher
from lfs10d.commands.handlers.registry import REQUESTS
from lfs10d.commands.line_access import LineAccess
from lfs10d.config.changes_file import ChangesFile
from lfs10d.config.effective import Effective
from lfs10d.config.live_config import Edit, LiveConfig
from lfs10d.config.loader import LoadedConfig
from lfs10d.config.models import Config
from lfs10d.config.reload import ReloadPlan
from lfs10d.daemon import signals
from lfs10d.daemon.boot import Boot, keep
from lfs10d.daemon.settings import config_hash, conflict_readings, device_facts, line_facts, store_limits
from lfs10d.daemon.signals import Signals
from lfs10d.daemon.state_directory import status_file
from lfs10d.daemon.status_file import StatusFile
from lfs10d.daemon.storage import Storage
from lfs10d.daemon.supervision import Supervision
from lfs10d.errors import StateError
from lfs10d.line.line import Line
from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.mqtt.topics import InboundRequest
from lfs10d.mqtt.uplink import Uplink
from lfs10d.outbox.store.store import Store
from lfs10d.reading import Event, Exchanged, FaultCode, PortChanged, Reading
from lfs10d.reconfiguration.baudrate_watch import BaudrateWatch
from lfs10d.reconfiguration.journal import Journal
from lfs10d.reconfiguration.reconfiguration import Reconfiguration
from lfs10d.reconfiguration.restore import Restore
from lfs10d.system import logs
from lfs10d.system.clock import Clock
from lfs10d.system.disk import Disk
from lfs10d.system.secret import Secret
from lfs10d.system.systemd import Notifier
from lfs10d.system.tasks import BackgroundTasks
from lfs10d.telemetry.event_log import EventLog, LogEntry
from lfs10d.telemetry.first_burst import FirstBurst
from lfs10d.telemetry.info import DaemonInfo
from lfs10d.telemetry.publication import Publication
from lfs10d.telemetry.start_report import WITHIN, StartReport
from lfs10d.telemetry.station import Station

log = logging.getLogger(__name__)

SWITCH_INTERVAL = 1e-4
"""Seconds the interpreter lets one thread run on: at the default of 5 ms the line thread wakes up 5 ms late."""
TICK_SLACK = 0.03
"""What time alone makes known may wait so long, in s, for a sample to go with: at 9600 baud they come every 26 ms."""

LINE_STOPS_WITHIN = 0.4
"""How long the line thread is waited for at the end, in s; with the uplink's 1.3 s it is over within 2 s."""


def _features(config: Config) -> tuple[str, ...]:
    return ("history",) if config.mqtt.telemetry else ()


class Daemon:
    """One line, from the port to the broker. Built and run inside an asyncio loop."""

    def __init__(self, loaded: LoadedConfig, boot: Boot, state_directory: Path, notifier: Notifier) -> None:
        self._running = LiveConfig(loaded, ChangesFile(state_directory, Disk()), self._hold)
        loaded, config = self._running.loaded, self._running.now.config
        self._notifier = notifier
        self._loop = asyncio.get_running_loop()
        self._over = asyncio.Event()
        self._failed = False
        self._tasks = BackgroundTasks(on_failure=self._failed_inside)
        self._moments = Clock()
        self._now = self._moments.now
        self._boot = boot
        self._state_directory = state_directory
        self._storage = Storage(state_directory, self._storage_told)
        self._signals = Signals(notifier, end=self._over.set, reload=self._reload, summary=self._summary)
        self._ticking: asyncio.TimerHandle | None = None
        self._event_log = EventLog()
        self._start_report = StartReport()
        self._facts = DaemonInfo(
            version=__version__,
            host=socket.gethostname(),
            boot=boot.id,
            previous_boot=boot.previous,
            config_hash=config_hash(config),
            changes=self._running.now.changes.count,
            mqtt={"version": config.mqtt.version},
            features=_features(config),
        )
        self._station = Station(
            self._facts,
            line_facts(config.line),
            device_facts(config, loaded.profiles),
            self._now(),
        )
        self._uplink = Uplink(
            self._broker_settings(),
            base=f"{config.mqtt.base_topic}/{config.line.name}",
            epoch_ms=self._moments.epoch_ms,
            store=Store(state_directory, boot=boot.id, limits=store_limits(config.store)),
        )
        self._uplink.send_samples(telemetry=config.mqtt.telemetry)
        self._first_burst = FirstBurst(self._station.burst(self._now()))
        self._powers = LineAccess(
            self._station,
            self._uplink,
            now=self._now,
            running=self._running,
            reload=self._reload,
            change=self._change,
            line=lambda: self._line,
            publish=self._publish,
        )
        self._service = Dispatcher(
            REQUESTS,
            self._powers,
            allowed=frozenset(config.commands),
            respond=self._uplink.respond,
            clear=self._uplink.clear_retained,
        )
        self._powers.physical = self._physical = Reconfiguration(
            Journal(state_directory, Disk()),
            running=lambda: self._running.now,
            change=self._change,
            learn=self._learn,
            wire=lambda: self._line,
            tell=self._powers.tell,
            recall=self._service.recall,
            act=self._powers.act,
            repoll=self._repoll,
            now=self._now,
        )
        self._losing = BaudrateWatch(
            running=lambda: self._running.now,
            new_run=self._physical.new_run,
            devices=lambda: tuple(self._line.poller.scheduler.devices.values()),
            tell=self._told_lost,
        )
        self._line = Line(config.line)
        self._line.take(self._physical.polled(), loaded.profiles)
        if self._running.missing:
            restore = Restore(
                running=lambda: self._running.now,
                learn=self._learn,
                devices=lambda: tuple(self._line.poller.scheduler.devices.values()),
                announce=self._powers.tell,
            )
            self._uplink.read_back(restore.topics, restore.on_retained)
        file = status_file(loaded.path, config.line.name, os.environ, root=os.geteuid() == 0)
        self._supervision = Supervision(
            notifier,
            None if file is None else StatusFile(file),
            declared=lambda: self._line.declared,
            snapshot=self._powers.health,
            summary=self._summary,
        )

    def _broker_settings(self) -> BrokerSettings:
        mqtt = self._running.now.config.mqtt
        return BrokerSettings.of(mqtt, client_id=mqtt.client_id or "", password=self._password)

    def _password(self) -> Secret | None:
        return self._running.loaded.password()

    async def run(self) -> int:
        """Measure and publish until SIGTERM or SIGINT; return the exit code."""
        self._signals.obey()
        sys.setswitchinterval(SWITCH_INTERVAL)
        config = self._running.now.config
        log.info(
            "lfs10d %s, boot %s: %s on %s at %d baud, %d slaves, broker %s",
            __version__, self._facts.boot, config.line.name, config.line.port, config.line.baudrate,
            len(config.slaves), config.mqtt.broker,
        )  # fmt: skip
        self._storage.look()
        self._tasks.start("clock", self._moments.watch(self._uplink))
        self._tasks.start("storage", self._storage.watch())
        self._tasks.start("supervision", self._supervision.run())
        try:
            self._physical.recall()
            self._line.start(self)
            await self._uplink.start(self)
            self._tick()
            self._tell_news()
            if not any(slave.enabled for slave in self._running.now.polled.slaves):
                self._signals.ready()
            await self._over.wait()
        finally:
            self._notifier.stopping("stopping")
            self._tasks.cancel_all()
            self._losing.stop()
            await self._physical.stop()
            await self._service.stop()
            await self._line.stop(LINE_STOPS_WITHIN)
            await self._uplink.stop()
        log.info("ended")
        return 1 if self._failed else 0

    # -- the line

    def on_events(self, events: list[Event]) -> None:
        """Publish what the line reports."""
        now = self._now()
        port, frames = self._line.port, log.isEnabledFor(logging.DEBUG)
        published: list[Publication] = []
        for event in events:
            self._enter(self._event_log.on_event(event, port=port.settings.path, notices=port.notices, frames=frames))
            self._watch_start(event)
            known = self._station.on_event(event, now)
            self._enter(self._event_log.on_publications(known))
            published += [*known, *self._powers.heard(event, known, now)]
            if isinstance(event, Exchanged) or (isinstance(event, PortChanged) and event.fault is not None):
                self._signals.ready()
        if self._station.due() <= now.mono:  # what is due goes with what was heard: one segment to the broker, not two
            published += self._station.tick(now, self._uplink.backlog)
        self._publish(published)
        if any(isinstance(event, PortChanged) and event.fault is None for event in events):
            self._yield(self._running.now.conflicts)
            self._physical.follow()
            self._losing.begin()

    def _watch_start(self, event: Event) -> None:
        """Report who answers after the port was opened."""
        report = self._start_report
        if isinstance(event, Reading):
            report.on_reading(event)
            if report.due < inf:
                self._report_start()
        elif isinstance(event, PortChanged):
            if event.fault is not None:
                report.on_port_lost()
                return
            report.on_port_open((slave.name for slave in self._running.now.polled.slaves if slave.enabled), event.at)
            self._loop.call_at(event.at + WITHIN + TICK_SLACK, self._report_start)

    def _report_start(self) -> None:
        entry = self._start_report.entry(self._now().mono)
        self._enter([] if entry is None else [entry])

    def _publish(self, publications: Iterable[Publication]) -> None:
        self._uplink.publish(self._first_burst.passing(publications))
        if self._ticking is not None and self._station.due() + TICK_SLACK < self._ticking.when():
            self._set_tick()

    def _enter(self, entries: Iterable[LogEntry]) -> None:
        for entry in entries:
            log.log(entry.level, "%s", entry.text)

    def on_failure(self, error: BaseException) -> None:
        """End the daemon: its line's thread ended by a mistake."""
        log.error("the line's thread ended", exc_info=error)
        self._failed_inside()

    def _failed_inside(self) -> None:
        """End the daemon with exit code 1, after an internal error that is logged; its service manager restarts it."""
        self._failed = True
        self._over.set()

    # -- time

    def _tick(self) -> None:
        """Publish what time alone makes known, and come back when more is due."""
        now = self._now()
        if self._station.due() <= now.mono:
            self._uplink.publish(self._first_burst.passing(self._station.tick(now, self._uplink.backlog)))
        self._set_tick()

    def _set_tick(self) -> None:
        if self._ticking is not None:
            self._ticking.cancel()
        self._ticking = self._loop.call_at(self._station.due() + TICK_SLACK, self._tick)

    def _summary(self) -> str:
        broker = "broker" if len(self._running.now.config.mqtt.nodes) == 1 else self._uplink.place
        state = f"{broker} connected" if self._uplink.connected else "broker away"
        return f"{self._station.summary(self._now())}, {state}"

    # -- the files

    async def _reload(self) -> ReloadPlan:
        """Read the files again and apply what changed; raises ConfigError and changes nothing if one is wrong."""
        plan = await self._running.reload()
        self._tell_news()
        return plan

    async def _change(self, edit: Edit) -> tuple[Effective, Effective]:
        """Apply what a request changes; raises StateError and changes nothing if it cannot be kept."""
        try:
            return await self._running.change(edit)
        except StateError as error:
            self._storage.failed(str(error))
            raise
        finally:
            self._tell_news()

    async def _learn(self, edit: Edit) -> tuple[Effective, Effective]:
        """Take up what was learnt of the line, kept or not."""
        try:
            return await self._running.learn(edit)
        finally:
            self._tell_news()

    def _tell_news(self) -> None:
        """Tell what became of changes that a person overruled, or that cannot hold."""
        news = self._running.news()
        for warning in news.sayings:
            log.warning("%s", warning)
        if news.storage is not None:
            self._storage.failed(news.storage)
        self._publish(news.events(self._now().ts()))

    def _storage_told(self, trouble: str | None) -> None:
        if trouble is None:
            if not self._boot.kept:
                self._boot = keep(self._boot, self._state_directory, Disk())
            self._publish(self._station.line_recovered(FaultCode.STORAGE_FULL, self._now()))
        else:
            self._publish(self._station.line_failed(FaultCode.STORAGE_FULL, trouble, self._now()))

    async def _hold(self, plan: ReloadPlan, before: Effective) -> None:
        """Put into force what holds from now on."""
        now = self._running.now
        config = now.config
        if plan.log:
            logs.install(config.log.level, config.log.format)
        if plan.publishing:
            self._uplink.send_samples(telemetry=config.mqtt.telemetry)
            devices = device_facts(config, now.loaded.profiles)
            self._publish(self._station.configure(line_facts(config.line), devices, self._now()))
        if plan.polling or plan.realtime or now.places != before.places:
            self._line.take(self._physical.polled(), now.loaded.profiles, line=plan.line, realtime=plan.realtime)
            if plan.line:
                self._losing.begin()
            devices = device_facts(config, now.loaded.profiles)
            self._publish(self._station.configure(line_facts(config.line), devices, self._now()))
            self._yield({name: why for name, why in now.conflicts.items() if name not in before.conflicts})
        self._service.allow(frozenset(config.commands))
        self._storage.look()
        self._facts = replace(
            self._facts, config_hash=config_hash(config), changes=now.changes.count, features=_features(config)
        )
        self._publish(self._station.introduce(self._facts, self._now()))
        self._powers.reconfigured(before.config, config)
        await self._physical.reconfigured(before.config, config)
        self._uplink.limit(store_limits(config.store))
        await self._uplink.reload(self._broker_settings() if plan.broker else None)

    def _repoll(self) -> None:
        """Poll what may be polled now that the line was asked where a device is."""
        self._line.take(self._physical.polled(), self._running.loaded.profiles, line=False, realtime=False)

    def _told_lost(self, words: str | None) -> None:
        """Raise or clear the error of a line whose sensors all speak at another rate."""
        now = self._now()
        if words is None:
            self._publish(self._station.line_recovered(FaultCode.WRONG_RATE, now))
        else:
            self._publish(self._station.line_failed(FaultCode.WRONG_RATE, words, now))

    def _yield(self, conflicts: Mapping[str, str]) -> None:
        """Tell of devices that are not polled, for their slave id is another's."""
        now = self._now()
        for reading in conflict_readings(conflicts, now.mono):
            self._publish(self._station.on_event(reading, now))

    # -- the broker

    def burst(self) -> list[Publication]:
        """Return every retained topic, with nothing known of the devices in the first burst."""
        return self._first_burst.burst(self._station.burst(self._now(), self._uplink.backlog))

    def topics(self) -> frozenset[str]:
        """Return the retained topics."""
        return self._station.topics()

    def on_request(self, request: InboundRequest) -> None:
        """Hand it to the dispatcher."""
        self._service.requested(request)

    def on_spool_trouble(self, trouble: str | None) -> None:
        """Report it as trouble of the storage."""
        self._storage.backlog_failed(trouble)

    def on_announced(self) -> None:
        """Publish what was held back for the first burst."""
        self._uplink.publish(self._first_burst.settle(self._station.burst(self._now())))

    def on_uplink_change(self) -> None:
        """Publish what is known of the broker now."""
        version = self._uplink.version
        now = self._now()
        if version is not None:
            self._facts = replace(self._facts, mqtt={"version": str(version)})
            self._publish(self._station.introduce(self._facts, now))
            self._publish(self._station.on_requests("denied" if self._uplink.requests_denied else "ok", now))
        if self._uplink.duplicate:
            message = "another client has taken our client id; give every daemon an mqtt.client_id of its own"
            self._publish(self._station.line_failed(FaultCode.DUPLICATE_CLIENT, message, now))
        else:
            self._publish(self._station.line_recovered(FaultCode.DUPLICATE_CLIENT, now))


async def run(loaded: LoadedConfig, boot: Boot, state_directory: Path) -> int:
    """Run the daemon of one configuration until it is told to end; return the exit code."""
    notifier = Notifier()
    try:
        return await Daemon(loaded, boot, state_directory, notifier).run()
    finally:
        notifier.close()
        signals.ignore()
