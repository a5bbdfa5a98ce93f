"""Starts the parts of a daemon in order and stops them in order.

The asyncio loop hosts MQTT, the station, commands and timers; the line thread owns the wire. What the line thread
reports comes here by one `call_soon_threadsafe` per exchange and goes through the station to the uplink.
"""

from __future__ import annotations

import logging
import sys
from pathlib import Path

from lfs10d import __version__
from lfs10d.config.loader import LoadedConfig
from lfs10d.daemon import signals
from lfs10d.daemon.apply import ConfigChanges
from lfs10d.daemon.boot import Boot
from lfs10d.daemon.line_events import LineReport
from lfs10d.daemon.pace import USUAL, Pace
from lfs10d.daemon.parts import Parts
from lfs10d.system.systemd import Notifier
from lfs10d.system.tasks import BackgroundTasks

log = logging.getLogger(__name__)

SWITCH_INTERVAL = 1e-4
"""Seconds the interpreter lets one thread run on: at the default of 5 ms the line thread wakes up 5 ms late."""
LINE_STOPS_WITHIN = 0.4
"""Longest wait in s for the line thread at the end; with the uplink's 1.3 s the daemon ends within 2 s."""


async def run(loaded: LoadedConfig, boot: Boot, state_directory: Path, pace: Pace = USUAL) -> int:
    """Run the daemon of one configuration until it is told to end; return the exit code."""
    notifier = Notifier()
    try:
        parts = Parts(loaded, boot, state_directory, notifier, pace)
        _log_start(parts, boot)
        return await _run(parts)
    finally:
        notifier.close()
        signals.ignore()


async def _run(parts: Parts) -> int:
    """Poll and publish until SIGTERM or SIGINT; return the exit code."""
    tasks = BackgroundTasks(on_failure=parts.shutdown.fail)
    sys.setswitchinterval(SWITCH_INTERVAL)
    parts.config.start(ConfigChanges(parts))
    parts.signals.obey()
    parts.storage.look()
    tasks.start("clock", parts.clock.watch(parts.uplink))
    tasks.start("storage", parts.storage.watch())
    tasks.start("supervision", parts.supervision.run())
    try:
        parts.reconfiguration.recall()
        parts.line.start(LineReport(parts))
        await parts.uplink.start(
            parts.publisher,
            on_request=parts.dispatcher.on_request,
            on_spool_trouble=parts.storage.on_backlog_trouble,
        )
        parts.publisher.start()
        if not any(slave.enabled for slave in parts.config.now.polled.slaves):
            parts.signals.ready()
        await parts.shutdown.wait()
    finally:
        parts.notifier.stopping("stopping")
        tasks.cancel_all()
        parts.baudrate_watch.stop()
        await parts.reconfiguration.stop()
        await parts.dispatcher.stop()
        await parts.line.stop(LINE_STOPS_WITHIN)
        await parts.uplink.stop()
    log.info("ended")
    return parts.shutdown.exit_code


def _log_start(parts: Parts, boot: Boot) -> None:
    config = parts.config.now.config
    log.info(
        "lfs10d %s, boot %s: %s on %s at %d baud, %d slaves, broker %s",
        __version__, boot.id, config.line.name, config.line.port, config.line.baudrate,
        len(config.slaves), config.mqtt.broker,
    )  # fmt: skip
