"""One log entry after the port was opened: how many devices answer, which are silent, which answer badly. Pure.

It is due when every device has answered or failed its polls of the start, `WITHIN` seconds after the
opening at the latest.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence
from math import inf

from lfs10d.reading import PORT_CODES, SILENT_CODES, START_POLLS, Reading
from lfs10d.telemetry.event_log import LogEntry

WITHIN = 9.5
"""Longest time in s from the opening of the port to the report."""

NAMED = 32
"""Most devices of one kind that are named."""


def _some(names: Sequence[str]) -> str:
    more = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (f" and {more} more" if more > 0 else "")


class StartReport:
    """The report on the start of polling; begun anew at each opening of the port."""

    def __init__(self) -> None:
        self.due = inf
        """Monotonic time of the report at the latest; infinite while none is due."""
        self._failures: dict[str, int] = {}
        self._waiting: set[str] = set()
        self._bad: dict[str, str] = {}

    def on_port_open(self, devices: Iterable[str], at: float) -> None:
        """Begin anew: the port was opened at the monotonic time `at`, and these devices are polled."""
        self._failures = dict.fromkeys(devices, 0)
        self._waiting = set(self._failures)
        self._bad = {}
        self.due = at + WITHIN if self._failures else inf

    def on_port_lost(self) -> None:
        """Report nothing: the port is lost."""
        self.due = inf

    def on_reading(self, reading: Reading) -> None:
        """Count a finished poll."""
        device, fault = reading.device, reading.fault
        if self.due == inf or device not in self._failures or (fault is not None and fault.code in PORT_CODES):
            return
        self._bad.pop(device, None)
        if fault is None or reading.online:
            self._failures[device] = 0
            self._waiting.discard(device)
            return
        self._failures[device] += 1
        if fault.code not in SILENT_CODES:
            self._bad[device] = fault.code.value
        if self._failures[device] >= START_POLLS:
            self._waiting.discard(device)

    def entry(self, now: float) -> LogEntry | None:
        """Return the log entry if it is due; once for each opening."""
        if self.due == inf or (self._waiting and now < self.due):
            return None
        self.due = inf
        silent = [
            name for name, failures in self._failures.items()
            if name not in self._bad and (failures or name in self._waiting)
        ]  # fmt: skip
        answering = len(self._failures) - len(silent) - len(self._bad)
        parts = [f"{answering} of {len(self._failures)} devices answer"]
        if silent:
            parts.append(f"silent: {_some(silent)}")
        if self._bad:
            parts.append(f"answering badly: {_some([f'{name} ({code})' for name, code in self._bad.items()])}")
        return LogEntry(logging.WARNING if silent or self._bad else logging.INFO, "; ".join(parts))
