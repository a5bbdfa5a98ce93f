"""Passes the events of the line on in order: to the log, the publisher, the commands, the service manager."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterable
from math import inf

from lfs10d.daemon.parts import Parts
from lfs10d.daemon.settings import conflict_readings
from lfs10d.mqtt.publisher import TICK_SLACK
from lfs10d.reading import Event, Exchanged, PortChanged, Reading
from lfs10d.telemetry.event_log import EventLog, LogEntry
from lfs10d.telemetry.publication import Publication
from lfs10d.telemetry.start_report import WITHIN, StartReport

log = logging.getLogger(__name__)


class LineReport:
    """The events of `Line`. Used in the thread of the asyncio loop."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._event_log = EventLog()
        self._start_report = StartReport()
        self._loop = asyncio.get_running_loop()

    def on_events(self, events: list[Event]) -> None:
        """Log and publish the events of an exchange, as one batch for the broker."""
        parts, now = self._parts, self._parts.clock.now()
        port, frames = parts.line.port, log.isEnabledFor(logging.DEBUG)
        published: list[Publication] = []
        opened = False
        for event in events:
            known = parts.publisher.on_event(event, now)
            if isinstance(event, Exchanged):  # every poll has one: nothing but counting, as a rule
                if frames:
                    _log(self._event_log.on_exchange(event))
                published += [*known, *parts.access.on_exchange(event, now)]
                parts.signals.ready()
                continue
            _log(self._event_log.on_event(event, port=port.settings.path, notices=port.notices))
            self._watch_start(event)
            _log(self._event_log.on_publications(known))
            published += known
            if isinstance(event, Reading):
                parts.access.on_reading(event, known)
            elif isinstance(event, PortChanged):
                opened = opened or event.fault is None
                if event.fault is not None:
                    parts.signals.ready()
        parts.publisher.publish([*published, *parts.publisher.due(now)])
        if opened:
            parts.publisher.on_readings(conflict_readings(parts.config.now.conflicts, now.mono))
            parts.reconfiguration.follow()
            parts.baudrate_watch.begin()

    def on_failure(self, error: BaseException) -> None:
        """End the daemon: the line's thread ended by an internal error."""
        log.error("the line thread ended: an internal error", exc_info=error)
        self._parts.shutdown.fail()

    def _watch_start(self, event: Event) -> None:
        """Report which devices answer after the port was opened."""
        report = self._start_report
        if isinstance(event, Reading):
            if report.due < inf:
                report.on_reading(event)
                self._report_start()
        elif isinstance(event, PortChanged):
            if event.fault is not None:
                report.on_port_lost()
                return
            slaves = self._parts.config.now.polled.slaves
            report.on_port_open((slave.name for slave in slaves if slave.enabled), event.at)
            self._loop.call_at(event.at + WITHIN + TICK_SLACK, self._report_start)

    def _report_start(self) -> None:
        entry = self._start_report.entry(self._parts.clock.now().mono)
        _log([] if entry is None else [entry])


def _log(entries: Iterable[LogEntry]) -> None:
    for entry in entries:
        log.log(entry.level, "%s", entry.text)
