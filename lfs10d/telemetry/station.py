"""From what the line tells to what the broker is told: a pure fold over events and time.

`heard` and `tick` return publications and keep what the next burst needs; nothing here waits, reads a clock
or knows a broker. Rules of the devices are in `standing`, rise and clear in `alarms`, figures in `tally`.

While the port is lost, or freed for another program (activity `paused`), the devices' own errors are masked:
one error of the line instead of one per device, and while paused none at all. The poller gives each device
one reading with the port's fault, which takes it offline.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, Literal, TypeAlias, assert_never

from lfs10d.reading import (
    PORT_CODES,
    AnsweredTwice,
    Event,
    Exchanged,
    Fault,
    FaultCode,
    LineFaultCode,
    PortChanged,
    Reading,
    UartCounted,
)
from lfs10d.system.clock import Instant
from lfs10d.telemetry.alarms import LineAlarm
from lfs10d.telemetry.counters import LineCounters
from lfs10d.telemetry.device_state import CLEARED_LEAVES, RETAINED_LEAVES, DeviceState
from lfs10d.telemetry.info import DaemonInfo, DeviceInfo, LineInfo
from lfs10d.telemetry.publication import (
    DEVICES,
    INFO,
    LINE_ERROR,
    LINE_STATE,
    LINE_STATS,
    VERSION,
    BacklogStats,
    Publication,
    device_topic,
    event,
    iso_time,
    retained,
)

__all__ = ["PAUSED", "POLLING", "DaemonInfo", "DeviceInfo", "Instant", "LineInfo", "Requests", "Station"]

STATS_EVERY: Final = 30.0
"""s between two publications of the statistics."""

POLLING: Final = "polling"
PAUSED: Final = "paused"

Requests: TypeAlias = Literal["ok", "denied"]

LINE_TOPICS: Final = (INFO, DEVICES, LINE_STATE, LINE_ERROR, LINE_STATS)


class Station:
    """The line and its devices as the broker knows them.

    `backlog` tells at any time what waits for the broker. Names in `devices` are distinct.
    """

    def __init__(
        self,
        daemon: DaemonInfo,
        line: LineInfo,
        devices: Sequence[DeviceInfo],
        now: Instant,
        *,
        backlog: Callable[[], BacklogStats] = BacklogStats,
    ) -> None:
        self._daemon = daemon
        self._line = line
        self._backlog = backlog
        self._clock = now.clock
        self._started = now.mono
        self._started_ts = now.ts()
        self._open = False
        self._activity = POLLING
        self._requests: Requests = "ok"
        self._port_fault: Fault | None = None
        self._alarm = LineAlarm()
        self._tally = LineCounters(now.mono)
        self._last_seqs: dict[str, int] = {}
        """Last number used of each device that was removed."""
        self._standings = {facts.name: self._stand(facts, now) for facts in devices}
        self._states_due: float | None = None
        self._stats_due = now.mono + STATS_EVERY

    def heard(self, happened: Event, now: Instant) -> list[Publication]:
        """Take one event of the line thread; return what it makes known, in order.

        Readings of devices unknown, or disabled and wanted by no request, are passed over: the poll was under way
        when they went.
        """
        published = self._watch_clock(now)
        match happened:
            case Exchanged():
                self._tally.exchanged(happened)
            case Reading():
                published += self._read(happened, now)
            case PortChanged():
                published += self._port_changed(happened, now)
            case UartCounted():
                self._tally.uart = happened.counters
            case AnsweredTwice():
                standing = self._standings.get(happened.device)
                if standing is not None and standing.facts.enabled and not self._masked:
                    published += standing.answered_twice(happened, now)
            case _:
                assert_never(happened)
        return published

    def tick(self, now: Instant) -> list[Publication]:
        """Return what time alone makes known: states that waited for their turn, statistics."""
        published = self._watch_clock(now)
        if self._states_due is not None and self._states_due <= now.mono:
            for standing in self._standings.values():
                state = standing.due_state(now)
                if state is not None:
                    published.append(state)
            self._states_due = self._next_state()
        if self._stats_due <= now.mono:
            self._stats_due += STATS_EVERY
            if self._stats_due <= now.mono:  # we slept: no statistics are made up for what was missed
                self._stats_due = now.mono + STATS_EVERY
            published.append(self._line_stats(now))
            published += [standing.stats(now) for standing in self._standings.values()]
        return published

    def _next_state(self) -> float | None:
        dues = (standing.state_due for standing in self._standings.values())
        return min((due for due in dues if due is not None), default=None)

    def due(self) -> float:
        """Return the monotonic time at which `tick` is wanted next."""
        return self._stats_due if self._states_due is None else min(self._states_due, self._stats_due)

    def burst(self, now: Instant) -> list[Publication]:
        """Return every retained topic in its newest form, `B/availability` excepted."""
        self._watch_clock(now)
        published = [
            self._info(),
            self._device_list(),
            self._line_state(),
            self._line_error(),
            self._line_stats(now),
        ]
        for standing in self._standings.values():
            published += standing.burst(now)
        return published

    def topics(self) -> frozenset[str]:
        """Return every retained topic this daemon stands behind, `B/availability` excepted."""
        leaves = (device_topic(name, leaf) for name in self._standings for leaf in RETAINED_LEAVES)
        return frozenset((*LINE_TOPICS, *leaves))

    def configure(self, line: LineInfo, devices: Sequence[DeviceInfo], now: Instant) -> list[Publication]:
        """Take the facts as they are now; return the difference, topics of what is gone cleared.

        A device is the same while its name is; with another profile it starts anew, but for its numbers.
        `line.name` is of this life: it does not change.
        """
        published = self._watch_clock(now)
        list_before = self._device_list()
        published += self._remove({facts.name for facts in devices}, now)
        standings: dict[str, DeviceState] = {}
        for facts in devices:
            standing = self._standings.get(facts.name)
            if standing is None or standing.facts.profile != facts.profile:
                if standing is None:
                    published.append(event("device_added", now.ts(), device=facts.name, slave=facts.slave))
                else:
                    self._last_seqs[facts.name] = standing.seq
                standing = self._stand(facts, now)
                published += standing.burst(now)
            elif standing.facts != facts:
                published += standing.reconfigure(facts, now)
            standings[facts.name] = standing
        self._standings = standings
        self._states_due = self._next_state()
        before, self._line = self._line, line
        if line.gap_required != before.gap_required:
            self._tally.retimed()
        if line != before:
            published.append(self._line_state())
        list_now = self._device_list()
        if list_now != list_before:
            published.append(list_now)
        return published

    def introduce(self, daemon: DaemonInfo, now: Instant) -> list[Publication]:
        """Take new facts about the daemon: protocol in use, count of changes, hash of the configuration."""
        published = self._watch_clock(now)
        before, self._daemon = self._daemon, daemon
        if daemon != before:
            published.append(self._info())
        return published

    def acting(self, activity: str, now: Instant) -> list[Publication]:
        """Take what the line is busy with: `polling`, `scanning`, `changing_baudrate`, `paused` ...

        While `paused` a lost port is nobody's error. When that ends the poller tells anew how the port is.
        """
        published = self._watch_clock(now)
        if activity == self._activity:
            return published
        self._activity = activity
        published.append(self._line_state())
        if activity == PAUSED:
            published += self._line_ended(PORT_CODES, now)
            published += self._mask(now)
        return published

    def admitting(self, requests: Requests, now: Instant) -> list[Publication]:
        """Take whether the broker lets requests through to us: `denied` where it refused the subscription."""
        published = self._watch_clock(now)
        if requests != self._requests:
            self._requests = requests
            published.append(self._line_state())
        return published

    def line_failed(self, code: LineFaultCode, message: str, now: Instant) -> list[Publication]:
        """Raise an error of the line that is not the port's: `wrong_rate`, `storage_full`, `duplicate_client`."""
        published = self._watch_clock(now)
        if self._alarm.failed(code, message, now.ts()):
            published.append(self._line_error())
        return published

    def line_recovered(self, code: LineFaultCode, now: Instant) -> list[Publication]:
        """Clear such an error; nothing happens if it is not raised."""
        return self._watch_clock(now) + self._line_ended(frozenset({code}), now)

    def snapshot(self, now: Instant) -> dict[str, object]:
        """Return what a live view shows, as plain data: the line, its error and pace, every device."""
        ts = now.ts()
        return {
            "v": VERSION,
            "ts": ts,
            "time": iso_time(ts),
            "info": self._daemon.payload(started=self._started_ts, clock=self._clock),
            "line": {
                "name": self._line.name,
                **self._state_payload(),
                **self._tally.rates(now.mono).payload(),
                "error": self._alarm.payload(),
            },
            "devices": [standing.snapshot(now) for standing in self._standings.values()],
        }

    def summary(self, now: Instant) -> str:
        """Return one line for a person: `7 of 8 slaves online, line 78 % busy`."""
        polled = [standing for standing in self._standings.values() if standing.facts.enabled]
        online = sum(standing.online for standing in polled)
        load = self._tally.rates(now.mono).load_pct
        busy = "" if load is None else f", line {load:.0f} % busy"
        return f"{online} of {len(polled)} slaves online{busy}"

    @property
    def _masked(self) -> bool:
        """Failures say nothing about the devices now."""
        return self._port_fault is not None or self._activity == PAUSED

    def _stand(self, facts: DeviceInfo, now: Instant) -> DeviceState:
        seq = self._last_seqs.pop(facts.name, 0)
        return DeviceState(facts, line=self._line.name, boot=self._daemon.boot, seq=seq, now=now)

    def _read(self, reading: Reading, now: Instant) -> list[Publication]:
        standing = self._standings.get(reading.device)
        if standing is None or not (standing.facts.enabled or reading.requests):
            return []
        apart = standing.tally.polled(reading, now.ts(reading.at))
        if reading.overruns:
            self._tally.overran(reading.overruns)
        if reading.fault is None or reading.fault.code not in PORT_CODES:
            self._tally.polled(reading, apart)
        published = standing.read(reading, now, masked=self._masked)
        due = standing.state_due
        if due is not None and (self._states_due is None or due < self._states_due):
            self._states_due = due
        return published

    def _port_changed(self, change: PortChanged, now: Instant) -> list[Publication]:
        fault = change.fault
        before = self._line_state()
        self._open = fault is None
        self._port_fault = fault
        published = [after] if (after := self._line_state()) != before else []
        ts = now.ts(change.at)
        if fault is None:
            return published + self._line_ended(PORT_CODES, now)
        if self._activity != PAUSED:
            self._tally.lost(fault.code)
            code: LineFaultCode = FaultCode.PORT_BUSY if fault.code is FaultCode.PORT_BUSY else FaultCode.PORT_LOST
            if self._alarm.failed(code, fault.message, ts):
                published.append(self._line_error())
        return published + self._mask(now)

    def _mask(self, now: Instant) -> list[Publication]:
        return [error for standing in self._standings.values() for error in standing.mask(now)]

    def _line_ended(self, codes: frozenset[FaultCode], now: Instant) -> list[Publication]:
        return [self._line_error()] if self._alarm.ended(codes, now.ts()) else []

    def _remove(self, staying: set[str], now: Instant) -> list[Publication]:
        published = []
        for name, standing in self._standings.items():
            if name not in staying:
                self._last_seqs[name] = standing.seq
                published += [retained(device_topic(name, leaf), None) for leaf in CLEARED_LEAVES]
                published.append(event("device_removed", now.ts(), device=name, slave=standing.facts.slave))
        return published

    def _watch_clock(self, now: Instant) -> list[Publication]:
        """Return `info` if the clock is another than before; when it was set, the start is told by it too."""
        if now.clock == self._clock:
            return []
        self._clock = now.clock
        self._started_ts = now.ts(self._started)
        return [self._info()]

    def _info(self) -> Publication:
        return retained(INFO, self._daemon.payload(started=self._started_ts, clock=self._clock))

    def _device_list(self) -> Publication:
        return retained(DEVICES, [standing.facts.entry() for standing in self._standings.values()])

    def _state_payload(self) -> dict[str, object]:
        return self._line.payload(is_open=self._open, activity=self._activity, requests=self._requests)

    def _line_state(self) -> Publication:
        return retained(LINE_STATE, self._state_payload())

    def _line_error(self) -> Publication:
        return retained(LINE_ERROR, self._alarm.payload())

    def _line_stats(self, now: Instant) -> Publication:
        payload = self._tally.payload(
            now.mono,
            ts=now.ts(),
            gap_required=self._line.gap_required,
            backlog=self._backlog(),
        )
        return retained(LINE_STATS, payload, qos=0, refresh=True)
