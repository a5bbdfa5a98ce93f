"""The state of the line as the broker knows it: its port, activity, error and statistics.

The port is lost (`fault` of the last change), or freed for another program (activity `paused`): in both cases failed
polls say nothing about the devices, and the line is `masked`. While paused a lost port is no error of the line either.
"""

from __future__ import annotations

from typing import Final, Literal, TypeAlias

from lfs10d.reading import PORT_CODES, Fault, FaultCode, LineFaultCode, PortChanged
from lfs10d.system.clock import Instant
from lfs10d.telemetry.alarms import LineAlarm
from lfs10d.telemetry.counters import LineCounters
from lfs10d.telemetry.info import LineInfo
from lfs10d.telemetry.publication import LINE_ERROR, LINE_STATE, LINE_STATS, BacklogStats, Publication, retained

POLLING: Final = "polling"
PAUSED: Final = "paused"

Requests: TypeAlias = Literal["ok", "denied"]
"""`denied`: the broker refused the subscription to requests."""


class LineState:
    """The line; `now` is when counting begins. Methods return what their event changes, in order."""

    def __init__(self, info: LineInfo, now: Instant) -> None:
        self.info = info
        self.activity = POLLING
        self.counters = LineCounters(now.mono)
        self._alarm = LineAlarm()
        self._open = False
        self._port_fault: Fault | None = None
        self._requests: Requests = "ok"

    @property
    def masked(self) -> bool:
        """Whether failed polls do not count for the devices now."""
        return self._port_fault is not None or self.activity == PAUSED

    def on_port_changed(self, change: PortChanged, now: Instant) -> list[Publication]:
        """Take a change of the port: opened, lost, or lost for another reason."""
        fault = change.fault
        before = self.state()
        self._open = fault is None
        self._port_fault = fault
        published = [after] if (after := self.state()) != before else []
        if fault is None:
            return published + self.recovered(PORT_CODES, now)
        if self.activity != PAUSED:
            self.counters.lost(fault.code)
            code: LineFaultCode = FaultCode.PORT_BUSY if fault.code is FaultCode.PORT_BUSY else FaultCode.PORT_LOST
            published += self.failed(code, fault.message, now.ts(change.at))
        return published

    def on_activity(self, activity: str, now: Instant) -> list[Publication]:
        """Take the line's activity; a pause clears the errors of the port."""
        if activity == self.activity:
            return []
        self.activity = activity
        return [self.state(), *(self.recovered(PORT_CODES, now) if activity == PAUSED else [])]

    def on_requests(self, requests: Requests) -> list[Publication]:
        """Take whether the broker permits requests."""
        if requests == self._requests:
            return []
        self._requests = requests
        return [self.state()]

    def reconfigure(self, info: LineInfo) -> list[Publication]:
        """Take another configuration; `name` stays. With another gap the measured gaps are counted anew."""
        before, self.info = self.info, info
        if info.gap_required != before.gap_required:
            self.counters.retimed()
        return [self.state()] if info != before else []

    def failed(self, code: LineFaultCode, message: str, ts: int) -> list[Publication]:
        """Raise an error of the line, or count it once more; `ts` is epoch milliseconds."""
        return [self.error()] if self._alarm.failed(code, message, ts) else []

    def recovered(self, codes: frozenset[FaultCode], now: Instant) -> list[Publication]:
        """Clear these errors of the line, if they are active."""
        return [self.error()] if self._alarm.ended(codes, now.ts()) else []

    def state(self) -> Publication:
        """Return `line/state`."""
        return retained(LINE_STATE, self._payload())

    def error(self) -> Publication:
        """Return `line/error`."""
        return retained(LINE_ERROR, self._alarm.payload())

    def stats(self, now: Instant, backlog: BacklogStats) -> Publication:
        """Return `line/stats`."""
        gap = self.info.gap_required
        payload = self.counters.payload(now.mono, ts=now.ts(), gap_required=gap, backlog=backlog)
        return retained(LINE_STATS, payload, qos=0, refresh=True)

    def snapshot(self, now: Instant) -> dict[str, object]:
        """Return the line for a live view."""
        return {
            "name": self.info.name,
            **self._payload(),
            **self.counters.rates(now.mono)._asdict(),
            "error": self._alarm.payload(),
        }

    def _payload(self) -> dict[str, object]:
        return self.info.payload(is_open=self._open, activity=self.activity, requests=self._requests)
