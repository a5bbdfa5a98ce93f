"""Log entries for events of the line: each change of state once. Pure.

A device is logged when its error rises or changes its code, and when it answers again. The loss of the port is one
entry for the line, none for its devices.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from lfs10d.reading import Event, Exchanged, PortChanged, Reading
from lfs10d.schema.quantities import duration_text
from lfs10d.telemetry.publication import ERROR, Publication, device_of


class LogEntry(NamedTuple):
    """One line of the log and its level."""

    level: int
    text: str


class EventLog:
    """Keeps which devices were reported as failing."""

    def __init__(self) -> None:
        self._failing: dict[str, str] = {}
        """Error code logged last, by device."""
        self._rested: set[str] = set()
        """Devices whose learned rest was reported."""

    def on_event(self, event: Event, *, port: str, notices: Sequence[str], frames: bool) -> list[LogEntry]:
        """Return the log entries of one event of the line thread; exchanges only where `frames` are wanted.

        `port` is the path, `notices` are warnings about the port that was opened.
        """
        if isinstance(event, PortChanged):
            if event.freed:
                return [LogEntry(logging.INFO, f"{port}: freed for another program")]
            if event.fault is not None:
                return [LogEntry(logging.WARNING, f"{event.fault.message}; tried again until it is back")]
            return [
                LogEntry(logging.INFO, f"{port}: the port is open"),
                *(LogEntry(logging.WARNING, notice) for notice in notices),
            ]
        if isinstance(event, Reading) and event.gap_learned and event.device not in self._rested:
            self._rested.add(event.device)
            gap = duration_text(event.request_gap)
            text = f"{event.device}: ignores a request right behind another, and is now given {gap} of rest before each"
            why = f"more if that is too short, see device/{event.device}/config"
            return [LogEntry(logging.WARNING, f"{text} ({why}): set request_gap for it in the configuration")]
        if frames and isinstance(event, Exchanged):
            heard = event.heard.hex(" ") or "nothing"
            fault = f": {event.fault}" if event.fault else ""
            return [LogEntry(logging.DEBUG, f"slave {event.slave}: sent {event.sent.hex(' ')}, heard {heard}{fault}")]
        return []

    def on_publications(self, publications: Iterable[Publication]) -> list[LogEntry]:
        """Return the log entries of the publications that one event caused."""
        entries: list[LogEntry] = []
        good: set[str] = set()
        for publication in publications:
            if publication.sample is not None and publication.sample.quality == "good":
                good.add(publication.sample.device)
            device = device_of(publication.topic, ERROR)
            if device is None:
                continue
            if isinstance(publication.payload, Mapping) and publication.payload["active"]:
                entries.append(self._failed(device, publication.payload))
            elif (code := self._failing.pop(device, None)) is not None and device in good:
                entries.append(LogEntry(logging.INFO, f"{device}: answers well again after {code}"))
        return entries

    def _failed(self, device: str, error: Mapping[str, object]) -> LogEntry:
        logged = device in self._failing
        code = self._failing[device] = str(error["code"])
        return LogEntry(logging.DEBUG if logged else logging.WARNING, f"{device}: {code}: {error['message']}")
