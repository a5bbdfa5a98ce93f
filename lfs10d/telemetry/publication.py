"""Samples, publications and events as plain values, and their topics under `B`.

`B` is `<base topic>/<line name>`; nothing here knows it. The models of the payloads, for the documentation
and the tests, are in `docs.generate.payloads`: building them costs megabytes that a running daemon need not spend.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from typing import ClassVar, Literal, NamedTuple, TypeAlias

from lfs10d.reading import NOTHING, FaultCode, Value
from lfs10d.system.clock_step import ClockState
from lfs10d.system.dataclass import dataclass

VERSION = 1
"""`v` of every payload that is an object."""

Payload: TypeAlias = Mapping[str, object] | list[dict[str, object]] | str | None

INFO = "info"
DEVICES = "devices"
LINE_STATE = "line/state"
LINE_ERROR = "line/error"
LINE_STATS = "line/stats"
EVENT = "event"
TRACE = "trace"

STATE = "state"
CONFIG = "config"
AVAILABILITY = "availability"
ERROR = "error"
STATS = "stats"
WIND = "wind"
RECORD = "record"
TELEMETRY = "telemetry"
HISTORY = "history"

ELSEWHERE = "/"
"""Prefix of a full topic that is not under `B`, for Home Assistant."""


def device_topic(device: str, leaf: str) -> str:
    """Return the topic under `B` of a device: `device/mast-top/state`."""
    return f"device/{device}/{leaf}"


def device_of(topic: str, leaf: str) -> str | None:
    """Return the device of a topic with this leaf, None for other topics."""
    levels = topic.split("/")
    return levels[1] if len(levels) == 3 and levels[0] == "device" and levels[2] == leaf else None  # noqa: PLR2004 - device/<name>/<leaf>


Quality: TypeAlias = Literal["good", "partial", "bad"]
"""All values, some, none."""


EventType: TypeAlias = Literal[
    "device_added",
    "device_removed",
    "readdressed",
    "baudrate_changed",
    "change_applied",
    "change_dropped",
    "change_conflict",
    "scan_progress",
    "duplicate_id",
    "dropped",
    "store_put_aside",
]
"""Every type of event the daemon publishes; docs/mqtt.md has a section for each."""


class PublicationKind(StrEnum):
    """How a publication is treated while the broker is away."""

    RETAINED = "retained"
    """Not kept: every burst after a connect has its newest version."""
    SAMPLE = "sample"
    """Never lost while the daemon runs: kept, and sent as history when older than 3 s. Records too."""
    EVENT = "event"
    RESPONSE = "response"
    TRACE = "trace"


_EPOCH = datetime.fromtimestamp(0, UTC).replace(tzinfo=None)


def iso_time(ts: int) -> str:
    """Return epoch milliseconds as ISO 8601 in UTC with milliseconds: `2026-11-21T21:53:42.003Z`."""
    return f"{(_EPOCH + timedelta(milliseconds=ts)).isoformat(timespec='milliseconds')}Z"


@dataclass(frozen=True, slots=True)
class Sample:
    """One finished poll as it is published; (line, device, boot, seq) is its key for ever.

    `ts` is epoch milliseconds. `names` are the profile's value names, so that a bad sample carries nulls;
    `values` is None exactly when `quality` is bad; numbers are finite. With quality partial some of them are None, and
    `errors` says why. `ages` are those in s of the values that are older than the device's interval.
    """

    device: str
    boot: str
    seq: int
    ts: int
    clock: ClockState
    values: Mapping[str, Value | None] | None
    units: Mapping[str, str]
    names: tuple[str, ...]
    quality: Quality
    error: str | None
    rtt_ms: float | None
    errors: Mapping[str, FaultCode] = field(default_factory=lambda: NOTHING)
    ages: Mapping[str, float] = field(default_factory=lambda: NOTHING)

    late_leaf: ClassVar = HISTORY
    """The last level of its topic when it is no longer live."""
    grouped: ClassVar = True
    """There it goes in an array with others; False: alone, as an object."""

    @property
    def source(self) -> str:
        """The series that `seq` counts: a device, or the records of a device."""
        return self.device

    @property
    def history_topic(self) -> str:
        """The topic under `B` when it is no longer live."""
        return device_topic(self.device, self.late_leaf)

    def header(self, line: str) -> dict[str, object]:
        """Return the first keys of every payload of a device."""
        return {
            "v": VERSION,
            "line": line,
            "device": self.device,
            "boot": self.boot,
            "seq": self.seq,
            "ts": self.ts,
            "time": iso_time(self.ts),
            "clock": self.clock,
        }

    def payload(self, line: str, *, historical: bool = False) -> dict[str, object]:
        """Return the flat JSON object: all value names, then `unit`, or `units` where there are several."""
        payload = self.header(line)
        values = self.values or NOTHING
        for name in self.names:
            payload[name] = values.get(name)
        if len(self.names) == 1:
            payload["unit"] = self.units.get(self.names[0])
        else:
            payload["units"] = dict(self.units)
        payload["quality"] = self.quality
        payload["error"] = self.error
        payload["rtt_ms"] = self.rtt_ms
        if self.errors:
            payload["errors"] = dict(self.errors)
        if self.ages:
            payload["ages"] = dict(self.ages)
        if historical:
            payload["historical"] = True
        return payload


@dataclass(frozen=True, slots=True)
class Publication:
    """One message for the broker; `topic` is under `B`, or a full one after `ELSEWHERE`.

    `payload` is an object or an array to be written as JSON, a bare word, or None to clear a retained topic.
    `sample` is set for kind SAMPLE alone, whose topic is `device/<name>/telemetry` or, of records, `record`. `refresh`:
    only newer figures of a retained topic, which may wait where the broker is slow and be replaced by the next.
    """

    topic: str
    payload: Payload
    kind: PublicationKind
    retain: bool
    qos: int
    sample: Sample | None = None
    refresh: bool = False


class BacklogStats(NamedTuple):
    """What waits for the broker: samples, epoch ms of the oldest (None: none), samples evicted since boot."""

    depth: int = 0
    oldest_ts: int | None = None
    dropped: int = 0


def retained(topic: str, payload: Payload, *, qos: int = 1, refresh: bool = False) -> Publication:
    """Return a retained publication; payload None clears the topic."""
    return Publication(topic, payload, PublicationKind.RETAINED, retain=True, qos=qos, refresh=refresh)


def event(kind: EventType, ts: int, **facts: object) -> Publication:
    """Return a publication on `event` of type `kind` at `ts` (epoch ms)."""
    payload = {"v": VERSION, "type": kind, "ts": ts, **facts}
    return Publication(EVENT, payload, PublicationKind.EVENT, retain=False, qos=1)


def dropped(source: str, boot: str, from_seq: int, to_seq: int, *, count: int, ts: int) -> Publication:
    """Return the event that declares `count` samples lost, within `from_seq`..`to_seq` both included.

    That of records, whose source is `<device>/record`, says so: `"topic":"record"`.
    """
    device, _, topic = source.partition("/")
    lost: dict[str, object] = {"device": device, "boot": boot, "from_seq": from_seq, "to_seq": to_seq, "count": count}
    if topic:
        lost["topic"] = topic
    return event("dropped", ts, **lost)
