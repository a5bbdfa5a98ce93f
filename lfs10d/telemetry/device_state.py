"""The state of one device as the broker knows it: its samples, state, availability, error and statistics.

Rules
-----
1. Every reading is one sample, numbered from 1 without gaps; `seq` goes on even when the device is removed and
   added again.
2. A value is published only with a good or partial reading, and availability is `online` while one is shown: it goes
   before the state of such a reading and after a bad one. A partial reading clears the device's error as a good one
   does.
3. The state shows the newest sample at most every `state_every`, but a change of quality or error at once, and of
   `errors`: another value that is missing, or another reason. It goes with the first sample whose time that is, so that
   none shows a sample that the next is about to overtake; by itself only where that sample does not come, or is far
   off, or where one came merely early. Of samples taken at one moment (`mqtt.hold`) it shows the last.
4. Before its first sample a device's state has no value and the error `starting` (a disabled one `disabled`), which
   is never in its error topic.
5. A disabled device has one sample that says so, and then none but those of polls that a request wants; of these
   nothing else is shown.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from typing import Final

from lfs10d.reading import NOTHING, PORT_CODES, AnsweredTwice, FaultCode, Reading
from lfs10d.system.clock import Instant
from lfs10d.telemetry.alarms import DeviceAlarm
from lfs10d.telemetry.counters import DeviceCounters
from lfs10d.telemetry.info import DeviceInfo
from lfs10d.telemetry.publication import (
    AVAILABILITY,
    CONFIG,
    ERROR,
    STATE,
    STATS,
    TELEMETRY,
    WIND,
    Publication,
    PublicationKind,
    Quality,
    Sample,
    device_topic,
    event,
    retained,
)

STATE_EARLY: Final = 0.03
"""Seconds that a state may come before its time (the next one then waits as much longer): otherwise a device polled
every second would miss its turn by the jitter of its polls, or by `mqtt.hold`, and be shown late each time."""

MERELY_EARLY: Final = 0.1
"""A state does not wait for the next sample where this one came early by so small a part of the time between two."""

SAMPLE_LATE: Final = 0.25
"""Seconds after its time for which a sample is waited for that a state is to go with."""


class DeviceState:
    """One device as the broker knows it; `seq` is its last number used in this boot (0: none)."""

    def __init__(self, info: DeviceInfo, *, line: str, boot: str, seq: int, now: Instant) -> None:
        self.info = info
        self.seq = seq
        self.online = False
        self.state_due: float | None = None
        """Monotonic time at which the waiting state may be published; None: none waits."""
        self._line = line
        self._boot = boot
        self._topics = {leaf: device_topic(info.name, leaf) for leaf in (STATE, AVAILABILITY, ERROR, STATS)}
        self._telemetry = device_topic(info.name, TELEMETRY)
        self._alarm = DeviceAlarm(info.offline_after)
        self._gap = info.request_gap
        self._counters = DeviceCounters(info.response_timeout, info.request_gap)
        self._last_good: float | None = None
        self._state_from = now.mono
        self._state_at = self._sampled = -inf
        code = FaultCode.STARTING if info.enabled else FaultCode.DISABLED
        self._sample = replace(self._form(0, now.ts(), now), error=code.value)
        self._payload = self._sample.payload(line)

    def on_reading(self, reading: Reading, now: Instant, *, masked: bool) -> tuple[list[Publication], float | None]:
        """Take and count one reading; return its publications, and the seconds since the previous poll (see `polled`).

        `masked`: the port is lost, so that failures say nothing about the device.
        """
        ts = now.ts(reading.at)
        since_last = self._counters.polled(reading, ts)
        return self._publish(reading, now, ts, masked=masked), since_last

    def _publish(self, reading: Reading, now: Instant, ts: int, *, masked: bool) -> list[Publication]:
        fault = reading.fault
        rested = self._rest(reading.request_gap)
        if not self.info.enabled:
            self.seq += 1
            sample = self._form(self.seq, ts, now, reading)
            return [self._telling(sample, sample.payload(self._line)), *rested]
        if fault is None:
            self._last_good = reading.at
            changed = self._alarm.ended(ts)
        elif masked or fault.code in PORT_CODES:
            changed = self._alarm.ended(ts)
        else:
            changed = not fault.busy and self._alarm.failed(fault, ts)
        self.seq += 1
        sample = self._form(self.seq, ts, now, reading)
        published = self._show(sample, now, online=reading.online or fault is None)
        if changed:
            published.append(self._error())
        return published + rested

    def _rest(self, gap: float) -> list[Publication]:
        """Take the rest in s between two requests; return the device's configuration if that changes it."""
        if gap == self._gap:
            return []
        self._gap = gap
        return [self._config()]

    def disable(self, now: Instant) -> list[Publication]:
        """Publish the one sample of a device that is no longer polled; its error becomes inactive."""
        self.seq += 1
        sample = replace(self._form(self.seq, now.ts(), now), error=FaultCode.DISABLED.value)
        return self._show(sample, now, online=False) + self.mask(now)

    def mask(self, now: Instant) -> list[Publication]:
        """Clear the device's own error: the fault is not the device's."""
        ended = self._alarm.ended(now.ts())
        return [self._error()] if self._alarm.set_lasting(None, now.ts()) or ended else []

    def on_answered_twice(self, heard: AnsweredTwice, now: Instant) -> list[Publication]:
        """Raise the error of a second answer to each request, or clear it."""
        ts = now.ts(heard.at)
        published = []
        if self._alarm.set_lasting(heard.fault, ts):
            published.append(self._error())
            if heard.fault is not None:
                facts = {"device": self.info.name, "slave": heard.slave, "message": heard.fault.message}
                published.append(event("duplicate_id", ts, **facts))
        return published

    def reconfigure(self, info: DeviceInfo, now: Instant) -> list[Publication]:
        """Take another configuration of the same device with the same profile; return the publications."""
        before, self.info = self.info, info
        self._alarm.rise_after = info.offline_after
        if info.request_gap != before.request_gap:
            self._gap = info.request_gap
        self._state_from = min(self._state_from, now.mono + info.state_every)
        if self.state_due is not None:
            self.state_due = self._state_from
        published = [self._config()] if info.payload() != before.payload() else []
        if before.enabled and not info.enabled:
            published += self.disable(now)
        return published

    def due_state(self, now: Instant) -> Publication | None:
        """Return the waiting state, if its time has come."""
        if self.state_due is None or self.state_due > now.mono:
            return None
        return self._state(now, refresh=True)

    def burst(self, now: Instant) -> list[Publication]:
        """Return every retained topic of this device."""
        return [
            self._state(now),
            self._config(),
            self._availability(),
            self._error(),
            self.stats(now),
        ]

    def stats(self, now: Instant) -> Publication:
        """Return the statistics."""
        return retained(self._topics[STATS], self._counters.payload(now.ts()), qos=0, refresh=True)

    def snapshot(self, now: Instant) -> dict[str, object]:
        """Return this device for a live view; `age_s` is the age of the last good reading."""
        info, sample, last_good = self.info, self._sample, self._last_good
        values = sample.values or NOTHING
        return {
            "name": info.name,
            "slave": info.slave,
            "label": info.label,
            "profile": info.profile,
            "enabled": info.enabled,
            "interval": info.interval,
            "online": self.online,
            "seq": sample.seq,
            "ts": sample.ts,
            "values": {name: values.get(name) for name in sample.names},
            "units": dict(sample.units),
            "quality": sample.quality,
            "error": sample.error,
            "errors": dict(sample.errors),
            "ages": dict(sample.ages),
            "rtt_ms": sample.rtt_ms,
            "age_s": None if last_good is None else round(max(0.0, now.mono - last_good), 1),
            "alarm": self._alarm.payload(),
        }

    def _form(self, seq: int, ts: int, now: Instant, reading: Reading | None = None) -> Sample:
        """Return the sample of a reading; without one a bad sample without an error."""
        values = fault = rtt = None
        errors: Mapping[str, FaultCode] = NOTHING
        ages: Mapping[str, float] = NOTHING
        if reading is not None:
            values, fault, rtt = reading.values, reading.fault, reading.rtt
            if values is not None:
                errors, ages = reading.value_errors, reading.ages
        quality: Quality = "bad" if values is None else "partial" if errors else "good"
        return Sample(
            device=self.info.name,
            boot=self._boot,
            seq=seq,
            ts=ts,
            clock=now.clock,
            values=values,
            units=self.info.units,
            names=self.info.value_names,
            quality=quality,
            error=None if fault is None else fault.code.value,
            rtt_ms=None if values is None or rtt is None else round(rtt * 1000, 1),
            errors=errors,
            ages=ages and {name: round(age, 3) for name, age in ages.items() if name not in errors},
        )

    def _show(self, sample: Sample, now: Instant, *, online: bool) -> list[Publication]:
        """Publish a sample, and state and availability if they change."""
        shown, apart = self._sample, now.mono - self._sampled
        self._sample, self._sampled = sample, now.mono
        self._payload = sample.payload(self._line)
        published = [self._telling(sample, self._payload)]
        turned, self.online = online is not self.online, online
        if turned and online:
            published.append(self._availability())
        if sample.error != shown.error or sample.quality != shown.quality or sample.errors != shown.errors:
            published.append(self._state(now))
        elif now.mono >= self._state_from - STATE_EARLY:
            published.append(self._state(now, refresh=True))
        elif now.mono == self._state_at:  # takes the place of the one from this moment, which is not sent yet
            published.append(retained(self._topics[STATE], self._payload, refresh=True))
        else:
            self.state_due = self._state_from
            early, near = self._state_from - now.mono, self.info.state_every + SAMPLE_LATE
            if early > MERELY_EARLY * apart and apart <= near:  # else the next sample is too far off to wait for
                self.state_due = max(self._state_from, now.mono + apart + SAMPLE_LATE)
        if turned and not online:
            published.append(self._availability())
        return published

    def _telling(self, sample: Sample, payload: dict[str, object]) -> Publication:
        return Publication(self._telemetry, payload, PublicationKind.SAMPLE, retain=False, qos=1, sample=sample)

    def _state(self, now: Instant, *, refresh: bool = False) -> Publication:
        """Return the newest state as published; `refresh`: quality and error are as before."""
        on_time = abs(now.mono - self._state_from) <= STATE_EARLY
        self._state_from = (self._state_from if on_time else now.mono) + self.info.state_every
        self._state_at, self.state_due = now.mono, None
        return retained(self._topics[STATE], self._payload, refresh=refresh)

    def _availability(self) -> Publication:
        return retained(self._topics[AVAILABILITY], "online" if self.online else "offline")

    def _error(self) -> Publication:
        return retained(self._topics[ERROR], self._alarm.payload())

    def _config(self) -> Publication:
        return retained(device_topic(self.info.name, CONFIG), self.info.payload(self._gap))


RETAINED_LEAVES: Final = (STATE, CONFIG, AVAILABILITY, ERROR, STATS)
"""Topics of every device."""

CLEARED_LEAVES: Final = (*RETAINED_LEAVES, WIND)
"""Topics to be cleared for a removed device."""
