"""The wind statistics of one device: when they are published, and its records. Pure: time is an argument.

Rules
-----
1. The topic `wind` is published every `every`, and at once when a figure of it stops being valid: when the newest value
   holds no longer, and when a mean turns null for want of values.
2. A value holds until the next good one, for at most two intervals of the device, and at least 2 s.
3. A disabled device's figures run out and are then published no more; it has no record of a span in which it was
   disabled all the time.
4. What waits in a long record is added up now and then, before it is forgotten.
5. A reading comes later than it was measured: it may wait for others, or until it is known to be the right answer. So
   figures are of the latest time by which no reading can be missing: that of the newest one, or a moment ago. That is
   their `ts`, and they are those of all samples up to then. A record is published when a reading from after its end is
   there, or a moment after its end.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Final

from lfs10d.reading import Value
from lfs10d.telemetry.info import DeviceInfo, WindInfo, WindValues
from lfs10d.telemetry.publication import (
    RECORD,
    VERSION,
    WIND,
    Publication,
    PublicationKind,
    Sample,
    device_topic,
    iso_time,
    retained,
)
from lfs10d.telemetry.wind.clock import WindMoment
from lfs10d.telemetry.wind.figures import (
    LONG,
    MINUTE,
    RATIO_DECIMALS,
    SHORT,
    MeasuredWind,
    WindTotals,
    record_figures,
)
from lfs10d.telemetry.wind.record import DIRECTION_NAMES, RECORD_NAMES, RecordSpans, WindRecord

HOLD_INTERVALS, HOLD_LEAST = 2, 2.0
"""A value holds for so many intervals at most, and for so many seconds at least."""

GUST_INTERVAL: Final = 1.0
"""s of the interval above which a mean of 3 s means nothing."""

LOOK_EVERY: Final = 1000
"""Milliseconds between two looks at figures that run out, at least."""

ADDED_UP_AFTER: Final = LONG + MINUTE // 2
"""Milliseconds of a long record after which they are added up; a little less than what is kept."""

LATE: Final = 1500
"""Milliseconds by which a reading comes late at most, but for what it waits for others (`mqtt.hold`)."""

_RUNNING_OUT: Final = (
    ("coverage_2m", SHORT, ("mean_2m", "direction_2m")),
    ("coverage_10m", LONG, ("mean_10m", "direction_10m")),
)

SHOWN: Final = ("unit", "mean_2m", "mean_10m", "gust_3s", "gust_10m", "direction_2m", "direction_10m")
"""Figures of a live view."""


class DeviceWind:
    """`info.wind` is not None; `seq` is the number of its last record in this boot."""

    def __init__(self, info: DeviceInfo, settings: WindInfo, line_boot: tuple[str, str], seq: int, at: int) -> None:
        self.info = info
        self.seq = seq
        self.line_boot = line_boot
        self._settings = settings
        self._hold = _hold(info)
        self._late = _late(settings)
        self._wind = MeasuredWind(settings.values)
        self._next_at = at + _milliseconds(settings.every)
        self._look_at: float = inf
        self._record_at: float = inf
        """When the span that is recorded next is over."""
        self._shown: dict[str, object] = {}
        self._samples: object = 0
        self._spans = _spans(settings, at)
        self._added = WindTotals()
        self._added_until = at

    @property
    def values(self) -> WindValues:
        """What is measured."""
        return self._settings.values

    def on_values(self, values: Mapping[str, Value | None], ages: Mapping[str, float], at: int) -> float:
        """Take the values of a good reading at `at`, as `MeasuredWind` does; return when `tick` is wanted for them."""
        self._wind.on_values(values, ages, at, self._hold)
        if self._look_at > at:  # a look that is due finds by itself how long the newest value holds
            held_until = self._wind.held_until
            if at < held_until < self._look_at:
                self._look_at = held_until
        return at if at >= self._record_at else self._look_at + self._late

    def due(self, moment: WindMoment) -> float:
        """Return when `tick` is wanted next, in ms."""
        if self._spans is None:
            return min(self._next_at, self._late + self._look_at)
        self._record_at = over = self._spans.due(moment.shift)
        record = over if over <= self._wind.newest else over + self._late
        look_at = min(self._look_at, self._added_until + ADDED_UP_AFTER)
        return min(self._next_at, record, self._late + look_at)

    def tick(self, moment: WindMoment) -> list[Publication]:
        """Return what is due."""
        known = self._known(moment)
        published = self._records(known)
        at, held_until = moment.at, self._wind.held_until
        if known.at < held_until:
            self._look_at = held_until
        if self._next_at <= at:
            every = _milliseconds(self._settings.every)
            self._next_at += every * ((at - self._next_at) // every + 1)
            if self.info.enabled or self._samples:
                published.append(self._publication(known, refresh=True))
        elif self._look_at <= known.at:
            published += self._look(known)
        return published

    def publication(self, moment: WindMoment) -> Publication:
        """Return the topic `wind` as it is now."""
        return self._publication(self._known(moment))

    def _known(self, moment: WindMoment) -> WindMoment:
        """Return the latest moment up to which all readings are known (rule 5); of a disabled device none counts."""
        if not self.info.enabled:
            return moment
        before = moment.at - max(self._wind.newest, moment.at - self._late)
        return WindMoment(moment.at - before, moment.ts - before, moment.clock)

    def _publication(self, moment: WindMoment, *, refresh: bool = False) -> Publication:
        figures = self._figures(moment)
        ts = moment.ts
        line, boot = self.line_boot
        self._shown = {"ts": ts, **{name: figures[name] for name in SHOWN if name in figures}}
        header = {"v": VERSION, "line": line, "device": self.info.name, "boot": boot, "ts": ts, "time": iso_time(ts)}
        payload = {**header, "clock": moment.clock, **figures}
        return retained(device_topic(self.info.name, WIND), payload, refresh=refresh)

    def snapshot(self) -> dict[str, object]:
        """Return what a live view shows: the figures that were published last."""
        return self._shown

    def reconfigure(self, info: DeviceInfo, settings: WindInfo, moment: WindMoment) -> list[Publication]:
        """Take other facts about the same device on the same profile; return what changed.

        With records of another length the span that runs begins anew.
        """
        before, self.info = self.info, info
        records, self._settings = self._settings.records, settings
        self._hold, self._late = _hold(info), _late(settings)
        self._next_at = min(self._next_at, moment.at + _milliseconds(settings.every))
        if settings.records != records:
            self._spans, self._record_at = _spans(settings, moment.at), inf
            self._added, self._added_until = WindTotals(), moment.at
        if before.enabled and not info.enabled:
            self._wind.end(moment.at)
            return self._look(moment)
        return []

    # Figures

    def _figures(self, moment: WindMoment) -> dict[str, object]:
        at, held_until = moment.at, self._wind.held_until
        figures = self._wind.figures(at, moment.shift, undersampled=self._undersampled)
        self._samples = figures["samples_10m"]
        self._look_at = held_until if at < held_until else self._runs_out(at, figures)
        return figures

    @property
    def _undersampled(self) -> bool:
        return self.info.interval > GUST_INTERVAL

    def _runs_out(self, at: int, figures: dict[str, object]) -> float:
        """Return when a mean may turn null though nothing is measured: its coverage falls by 1 s a second at most."""
        looks = [inf]
        for coverage, window, names in _RUNNING_OUT:
            covered = figures[coverage]
            if isinstance(covered, float) and any(figures.get(name) is not None for name in names):
                looks.append(at + max(LOOK_EVERY, (covered - 0.5) * window))
        return min(looks)

    def _look(self, moment: WindMoment) -> list[Publication]:
        """Return the topic `wind` if a figure that was shown is valid no longer."""
        shown = self._shown
        published = self._publication(moment)
        if any(self._shown[name] is None and shown.get(name) is not None for name in self._shown):
            return [published]
        self._shown = shown
        return []

    # Records

    def _records(self, moment: WindMoment) -> list[Publication]:
        if self._spans is None:
            return []
        published = []
        while (span := self._spans.take(moment.at, moment.shift)) is not None:
            totals, self._added = self._added, WindTotals()
            if self._added_until < span.end:
                totals.add(self._wind.totals(self._added_until, span.end))
            if self.info.enabled or self._wind.samples(totals):
                published.append(self._record(totals, span.end, span.to, moment))
            self._added_until = max(span.end, self._added_until)
        if moment.at - self._added_until >= ADDED_UP_AFTER:
            self._added.add(self._wind.totals(self._added_until, moment.at))
            self._added_until = moment.at
        return published

    def _record(self, totals: WindTotals, end: int, to: int, moment: WindMoment) -> Publication:
        self.seq += 1
        line, boot = self.line_boot
        length, values = _milliseconds(self._settings.records), self._settings.values
        figures = record_figures(totals, end, length, undersampled=self._undersampled)
        figures |= {
            "length": length,
            "samples": self._wind.samples(totals),
            "coverage": round(min(1.0, self._wind.covered(totals) / length), RATIO_DECIMALS),
        }
        record: Sample = WindRecord(
            device=self.info.name,
            boot=boot,
            seq=self.seq,
            ts=to,
            clock=moment.clock,
            values=figures,
            units={} if values.unit is None else {"mean": values.unit},
            names=RECORD_NAMES if values.direction is None else (*RECORD_NAMES, *DIRECTION_NAMES),
            quality="good",
            error=None,
            rtt_ms=None,
        )
        topic = device_topic(self.info.name, RECORD)
        return Publication(topic, record.payload(line), PublicationKind.SAMPLE, retain=False, qos=1, sample=record)


def _milliseconds(seconds: float) -> int:
    return round(seconds * 1000)


def _hold(info: DeviceInfo) -> int:
    return _milliseconds(max(HOLD_INTERVALS * info.interval, HOLD_LEAST))


def _late(settings: WindInfo) -> int:
    return LATE + _milliseconds(settings.hold)


def _spans(settings: WindInfo, at: int) -> RecordSpans | None:
    return RecordSpans(_milliseconds(settings.records), at) if settings.records else None
