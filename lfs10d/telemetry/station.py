"""Turns events of the line and time into publications about the line and its devices. Pure.

`on_event` and `tick` return publications and keep what the next burst needs; nothing here waits, reads a clock
or knows a broker. The rules of the line are in `line_state`, those of a device in `device_state`, rise and clear of
errors in `alarms`, statistics in `counters`, the wind in `wind.station`.

While the port is lost, or freed for another program (activity `paused`), the devices' own errors are masked:
one error of the line instead of one per device, and while paused none at all. The poller gives each device
one reading with the port's fault, which takes it offline.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Final, assert_never

from lfs10d.reading import (
    PORT_CODES,
    AnsweredTwice,
    Event,
    Exchanged,
    LineFaultCode,
    PortChanged,
    Reading,
    UartCounted,
)
from lfs10d.system.clock import Instant
from lfs10d.telemetry.device_state import CLEARED_LEAVES, RETAINED_LEAVES, DeviceState
from lfs10d.telemetry.info import DaemonInfo, DeviceInfo, LineInfo
from lfs10d.telemetry.line_state import PAUSED, LineState, Requests
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
from lfs10d.telemetry.wind.station import WindStation

STATS_EVERY: Final = 30.0
"""Seconds between two publications of the statistics."""

NOTHING_WAITS: Final = BacklogStats()

LINE_TOPICS: Final = (INFO, DEVICES, LINE_STATE, LINE_ERROR, LINE_STATS)


class Station:
    """One daemon, its line and its devices. Names in `devices` are distinct."""

    def __init__(
        self,
        daemon: DaemonInfo,
        line: LineInfo,
        devices: Sequence[DeviceInfo],
        now: Instant,
    ) -> None:
        self._daemon = daemon
        self._line = LineState(line, now)
        self._clock = now.clock
        self._started = now.mono
        self._started_ts = now.ts()
        self._last_seqs: dict[str, int] = {}
        """Last sample number used of each device that was removed."""
        self._devices = {info.name: self._new_device(info, now) for info in devices}
        self._wind = WindStation(line.name, daemon.boot, devices, now)
        self._held_back: dict[str, float] = {}
        """When the states held back are due, by device: monotonic s."""
        self._states_due = inf
        self.stats_due = now.mono + STATS_EVERY
        """When `tick` next publishes statistics: monotonic s."""

    def on_event(self, happened: Event, now: Instant) -> list[Publication]:
        """Take one event of the line thread; return its publications, in order.

        Readings of unknown devices, and of disabled ones that no request wants, are ignored: their poll was under
        way when the device went.
        """
        published = self._watch_clock(now) if now.clock != self._clock else []
        match happened:
            case Exchanged():
                self._line.counters.exchanged(happened)
            case Reading():
                published += self._on_reading(happened, now)
            case PortChanged():
                published += self._line.on_port_changed(happened, now)
                if happened.fault is not None:
                    published += self._mask(now)
            case UartCounted():
                self._line.counters.uart = happened.counters
            case AnsweredTwice():
                device = self._devices.get(happened.device)
                if device is not None and device.info.enabled and not self._line.masked:
                    published += device.on_answered_twice(happened, now)
            case _:
                assert_never(happened)
        return published

    def tick(self, now: Instant, backlog: BacklogStats = NOTHING_WAITS) -> list[Publication]:
        """Return the publications that are due by time: states held back, statistics.

        `backlog` is what waits for the broker, wanted from `stats_due` on.
        """
        published = self._watch_clock(now)
        if self._states_due <= now.mono:
            for name in [name for name, due in self._held_back.items() if due <= now.mono]:
                state = self._devices[name].due_state(now)
                if state is not None:
                    published.append(state)
                self._hold_back(name)
        if self.stats_due <= now.mono:
            self.stats_due += STATS_EVERY
            if self.stats_due <= now.mono:  # the process was stopped: missed statistics are not made up
                self.stats_due = now.mono + STATS_EVERY
            published.append(self._line.stats(now, backlog))
            published += [device.stats(now) for device in self._devices.values()]
        if self._wind.due <= now.mono:
            published += self._wind.tick(now)
        return published

    def _hold_back(self, name: str) -> None:
        """Note whether, and until when, the state of a device is held back."""
        due = self._devices[name].state_due
        if due is not None:
            self._held_back[name] = due
        elif self._held_back.pop(name, None) is None:
            return
        self._states_due = min(self._held_back.values(), default=inf)

    def due(self) -> float:
        """Return the monotonic time at which `tick` is wanted next."""
        return min(self.stats_due, self._wind.due, self._states_due)

    def burst(self, now: Instant, backlog: BacklogStats = NOTHING_WAITS) -> list[Publication]:
        """Return every retained topic in its newest form, `B/availability` excepted."""
        self._watch_clock(now)
        published = [
            self._info(),
            self._device_list(),
            self._line.state(),
            self._line.error(),
            self._line.stats(now, backlog),
        ]
        for name, device in self._devices.items():
            published += [*device.burst(now), *self._wind.burst(name, now)]
        return published

    def topics(self) -> frozenset[str]:
        """Return every retained topic of this daemon, `B/availability` excepted."""
        leaves = (device_topic(name, leaf) for name in self._devices for leaf in RETAINED_LEAVES)
        return frozenset((*LINE_TOPICS, *leaves, *self._wind.topics()))

    def configure(self, line: LineInfo, devices: Sequence[DeviceInfo], now: Instant) -> list[Publication]:
        """Take another configuration; return the changed publications, with the topics of removed devices cleared.

        A device is the same while its name is; with another profile it starts anew, but for its sample numbers.
        `line.name` does not change while the process lives.
        """
        published = self._watch_clock(now)
        list_before = self._device_list()
        published += self._remove({info.name for info in devices}, now)
        configured: dict[str, DeviceState] = {}
        for info in devices:
            device = self._devices.get(info.name)
            if device is None or device.info.profile != info.profile:
                if device is None:
                    published.append(event("device_added", now.ts(), device=info.name, slave=info.slave))
                else:
                    self._last_seqs[info.name] = device.seq
                device = self._new_device(info, now)
                published += device.burst(now)
            elif device.info != info:
                published += device.reconfigure(info, now)
            configured[info.name] = device
        self._devices = configured
        self._held_back, self._states_due = {}, inf
        for name in configured:
            self._hold_back(name)
        published += self._wind.configure(devices, now)
        published += self._line.reconfigure(line)
        list_now = self._device_list()
        if list_now != list_before:
            published.append(list_now)
        return published

    def introduce(self, daemon: DaemonInfo, now: Instant) -> list[Publication]:
        """Take other values of `info`: protocol in use, count of changes, hash of the configuration."""
        published = self._watch_clock(now)
        before, self._daemon = self._daemon, daemon
        if daemon != before:
            published.append(self._info())
        return published

    def on_activity(self, activity: str, now: Instant) -> list[Publication]:
        """Take the line's activity: `polling`, `scanning`, `changing_baudrate`, `paused` ...

        When a pause ends, the poller reports the state of the port anew.
        """
        published = self._watch_clock(now)
        changed = self._line.on_activity(activity, now)
        masked = self._mask(now) if changed and activity == PAUSED else []
        return published + changed + masked

    def on_requests(self, requests: Requests, now: Instant) -> list[Publication]:
        """Take whether the broker permits requests: `denied` if it refused the subscription."""
        return self._watch_clock(now) + self._line.on_requests(requests)

    def set_line_error(self, code: LineFaultCode, message: str | None, now: Instant) -> list[Publication]:
        """Raise an error of the line that is not the port's, or clear it (None).

        They are `wrong_rate`, `storage_full` and `duplicate_client`.
        """
        published = self._watch_clock(now)
        if message is None:
            return published + self._line.recovered(frozenset({code}), now)
        return published + self._line.failed(code, message, now.ts())

    def snapshot(self, now: Instant) -> dict[str, object]:
        """Return the data of a live view: the line, its error and rates, every device."""
        ts = now.ts()
        return {
            "v": VERSION,
            "ts": ts,
            "time": iso_time(ts),
            "info": self._daemon.payload(started=self._started_ts, clock=self._clock),
            "line": self._line.snapshot(now),
            "devices": [
                {**device.snapshot(now), **self._wind.snapshot(name)} for name, device in self._devices.items()
            ],
        }

    def summary(self, now: Instant) -> str:
        """Return one line for a person: `7 of 8 slaves online, line 78 % busy`."""
        polled = [device for device in self._devices.values() if device.info.enabled]
        online = sum(device.online for device in polled)
        load = self._line.counters.rates(now.mono).load_pct
        busy = "" if load is None else f", line {load:.0f} % busy"
        return f"{online} of {len(polled)} slaves online{busy}"

    def _new_device(self, info: DeviceInfo, now: Instant) -> DeviceState:
        seq = self._last_seqs.pop(info.name, 0)
        return DeviceState(info, line=self._line.info.name, boot=self._daemon.boot, seq=seq, now=now)

    def _on_reading(self, reading: Reading, now: Instant) -> list[Publication]:
        device = self._devices.get(reading.device)
        if device is None or not (device.info.enabled or reading.requests):
            return []
        published, since_last = device.on_reading(reading, now, masked=self._line.masked)
        if reading.overruns:
            self._line.counters.overran(reading.overruns)
        if reading.fault is None or reading.fault.code not in PORT_CODES:
            self._line.counters.polled(reading, since_last)
        self._wind.on_reading(reading, now)
        self._hold_back(reading.device)
        return published

    def _mask(self, now: Instant) -> list[Publication]:
        return [error for device in self._devices.values() for error in device.mask(now)]

    def _remove(self, staying: set[str], now: Instant) -> list[Publication]:
        published = []
        for name, device in self._devices.items():
            if name not in staying:
                self._last_seqs[name] = device.seq
                published += [retained(device_topic(name, leaf), None) for leaf in CLEARED_LEAVES]
                published.append(event("device_removed", now.ts(), device=name, slave=device.info.slave))
        return published

    def _watch_clock(self, now: Instant) -> list[Publication]:
        """Return `info` if the state of the clock changed, with the start time corrected."""
        if now.clock == self._clock:
            return []
        self._clock = now.clock
        self._started_ts = now.ts(self._started)
        return [self._info()]

    def _info(self) -> Publication:
        return retained(INFO, self._daemon.payload(started=self._started_ts, clock=self._clock))

    def _device_list(self) -> Publication:
        return retained(DEVICES, [device.info.entry() for device in self._devices.values()])
