"""The composition root: the parts of a daemon, built in the order of the floors. No part is given a later one.

What a part reports to later ones, it is given at its start: see `lfs10d.daemon.daemon`.
"""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path

from lfs10d.commands.admission import Admission
from lfs10d.commands.context import Context
from lfs10d.commands.dispatcher import Dispatcher
from lfs10d.commands.handlers.registry import HANDLERS
from lfs10d.commands.line_access import LineAccess
from lfs10d.commands.responder import Responder
from lfs10d.config.changes_file import ChangesFile
from lfs10d.config.live_config import LiveConfig
from lfs10d.config.loader import LoadedConfig
from lfs10d.daemon.boot import Boot
from lfs10d.daemon.discovery import AnnouncedPrefixes, discovery_payloads
from lfs10d.daemon.pace import USUAL, Pace
from lfs10d.daemon.settings import broker_settings, daemon_info, device_infos, line_info, store_limits
from lfs10d.daemon.shutdown import Shutdown
from lfs10d.daemon.signals import Signals
from lfs10d.daemon.state_directory import status_file
from lfs10d.daemon.status_file import StatusFile
from lfs10d.daemon.storage import Storage
from lfs10d.daemon.supervision import Supervision
from lfs10d.line.line import Line
from lfs10d.mqtt.publisher import Publisher
from lfs10d.mqtt.uplink import Uplink
from lfs10d.outbox.store.store import Store
from lfs10d.reading import FaultCode
from lfs10d.reconfiguration.baudrate_watch import BaudrateWatch
from lfs10d.reconfiguration.journal import Journal
from lfs10d.reconfiguration.reconfiguration import Reconfiguration
from lfs10d.reconfiguration.restore import Restore
from lfs10d.reconfiguration.runner import ChangeRunner
from lfs10d.system.clock import Clock
from lfs10d.system.disk import Disk
from lfs10d.system.systemd import Notifier
from lfs10d.telemetry.station import Station


class Parts:
    """Everything that runs, none of it started. Built in the asyncio loop, while it runs."""

    def __init__(
        self, file: LoadedConfig, boot: Boot, state_directory: Path, notifier: Notifier, pace: Pace = USUAL
    ) -> None:
        self.notifier = notifier
        self.shutdown = Shutdown()
        self.clock = clock = Clock()
        self.config = config = LiveConfig(file, ChangesFile(state_directory, Disk()))
        loaded, now = config.loaded, config.now.config

        info = daemon_info(config.now, boot)
        station = Station(info, line_info(now.line), device_infos(now, loaded.profiles), clock.now())
        self.uplink = uplink = Uplink(
            broker_settings(config),
            base=f"{now.mqtt.base_topic}/{now.line.name}",
            epoch_ms=clock.epoch_ms,
            store=Store(state_directory, boot=boot.id, limits=store_limits(now.store)),
            history_wait=pace.history_wait,
        )
        uplink.send_samples(telemetry=now.mqtt.telemetry)
        prefixes = AnnouncedPrefixes(state_directory, Disk())
        uplink.discovery.remember(prefixes.load(), prefixes.save)
        uplink.discovery.configure(now.homeassistant.prefix, discovery_payloads(now, loaded.profiles))
        self.publisher = publisher = Publisher(station, info, uplink, clock)
        self.storage = Storage(state_directory, boot, publisher.set_line_error)

        self.line = line = Line(now.line)
        responder = Responder(
            Admission({name: each.spec for name, each in HANDLERS.items()}, frozenset(now.commands)), uplink
        )
        runner = ChangeRunner(
            Journal(state_directory, Disk()),
            running=lambda: config.now,
            change=config.change,
            learn=config.learn,
            wire=lambda: line,
            announce=publisher.announce,
            recall=responder.recall,
            now=clock.now,
            share=pace.change_share,
        )
        self.reconfiguration = Reconfiguration(
            runner, act=publisher.act, repoll=lambda polled: line.take(polled, config.loaded.profiles)
        )
        line.take(self.reconfiguration.polled(), loaded.profiles)
        self.baudrate_watch = BaudrateWatch(
            running=lambda: config.now,
            new_run=self.reconfiguration.new_run,
            devices=line.devices,
            report=partial(publisher.set_line_error, FaultCode.WRONG_RATE),
        )
        if config.missing:
            restore = Restore(
                running=lambda: config.now, learn=config.learn, devices=line.devices, announce=publisher.announce
            )
            uplink.read_back(restore.topics, restore.on_retained)

        self.access = LineAccess(line, config, publisher, self.reconfiguration)
        context = Context(config, self.access, self.reconfiguration, publisher)
        self.dispatcher = Dispatcher(HANDLERS, context, responder)

        path = status_file(loaded.path, now.line.name, os.environ, root=os.geteuid() == 0)
        self.signals = Signals(notifier, end=self.shutdown.request, reload=config.reload, summary=publisher.summary)
        self.supervision = Supervision(
            notifier,
            None if path is None else StatusFile(path),
            declared=lambda: line.declared,
            snapshot=publisher.health,
            summary=publisher.summary,
        )
