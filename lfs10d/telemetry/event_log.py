"""Log entries for events of the line: each change of state once. Pure.

A device is logged when its error rises or changes its code, and when it answers again. The loss of the port is one
entry for the line, none for its devices. A value that is missing while others go on is logged once for each reason.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from lfs10d.reading import Event, Exchanged, FaultCode, PortChanged, Reading
from lfs10d.schema.quantities import duration_text
from lfs10d.telemetry.publication import ERROR, Publication, device_of

_MISSING: Final[Mapping[FaultCode, str]] = {
    FaultCode.UNAVAILABLE: "the device reports no value now",
    FaultCode.NOT_FINITE: "it is NaN or infinite",
    FaultCode.OUT_OF_RANGE: "the number is impossible",
    FaultCode.EXCEPTION: "the device refuses it",
}
"""Reasons of missing values, in words."""


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
        self._missing: set[tuple[str, str, FaultCode]] = set()
        """Device, value and reason of the missing values that were reported."""

    def on_exchange(self, exchanged: Exchanged) -> list[LogEntry]:
        """Return the log entry that shows the frames of an exchange."""
        heard = exchanged.heard.hex(" ") or "nothing"
        fault = f": {exchanged.fault}" if exchanged.fault else ""
        text = f"slave {exchanged.slave}: sent {exchanged.sent.hex(' ')}, received {heard}{fault}"
        return [LogEntry(logging.DEBUG, text)]

    def on_event(self, event: Event, *, port: str, notices: Sequence[str]) -> list[LogEntry]:
        """Return the log entries of one event of the line thread that is no exchange.

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
        if isinstance(event, Reading) and (event.gap_learned or event.value_errors):
            return [*self._learned_rest(event), *self._missing_values(event)]
        return []

    def _learned_rest(self, reading: Reading) -> list[LogEntry]:
        if not reading.gap_learned or reading.device in self._rested:
            return []
        self._rested.add(reading.device)
        gap = duration_text(reading.request_gap)
        text = f"{reading.device}: ignores a request right behind another, and is now given {gap} of rest before each"
        why = f"more if that is too short, see device/{reading.device}/config"
        return [LogEntry(logging.WARNING, f"{text} ({why}): set request_gap for it in the configuration")]

    def _missing_values(self, reading: Reading) -> list[LogEntry]:
        """Return the entries about missing values of partial samples: one for each value and reason."""
        if reading.values is None:
            return []
        entries = []
        for name, code in reading.value_errors.items():
            missing = (reading.device, name, code)
            if missing not in self._missing:
                self._missing.add(missing)
                text = (
                    f"{reading.device}: {name} has no value, the others go on: {code}, {_MISSING[code]} (logged once)"
                )
                entries.append(LogEntry(logging.INFO, text))
        return entries

    def on_publications(self, publications: Iterable[Publication]) -> list[LogEntry]:
        """Return the log entries of the publications that one event caused."""
        entries: list[LogEntry] = []
        good: set[str] = set()
        for publication in publications:
            if publication.sample is not None:
                if publication.sample.quality != "bad":
                    good.add(publication.sample.device)
                continue
            device = None if publication.refresh else device_of(publication.topic, ERROR)
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
