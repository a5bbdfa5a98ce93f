"""The table of published topics: every topic under `B`, the model of its payload, and when it is published.

For `docs/mqtt.md` and for the tests.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any

from pydantic import Field, TypeAdapter

from docs.generate.payloads import (
    Availability,
    DeviceConfig,
    DeviceEntry,
    DeviceStats,
    DroppedPayload,
    Error,
    Event,
    Info,
    LineStatePayload,
    LineStats,
    Response,
    SamplePayload,
    TracePayload,
)
from docs.generate.wind_payloads import RecordPayload, WindPayload
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry import publication


@dataclass(frozen=True, slots=True)
class Outbound:
    """One topic under `B`; `+` is any one level, `form` is the model of its JSON."""

    topic: str
    form: Any
    retain: bool
    qos: int
    when: str

    def matches(self, topic: str) -> bool:
        """Return whether `topic` (under `B`) matches."""
        pattern, levels = self.topic.split("/"), topic.split("/")
        return len(pattern) == len(levels) and all(
            wanted in ("+", level) for wanted, level in zip(pattern, levels, strict=True)
        )


def _device(leaf: str) -> str:
    return publication.device_topic("+", leaf)


CHANGE = "connect, change"
RISE = "active, change of code, cleared"

OUTBOUND = (
    Outbound(publication.INFO, Info, retain=True, qos=1, when=CHANGE),
    Outbound(publication.DEVICES, list[DeviceEntry], retain=True, qos=1, when=CHANGE),
    Outbound(publication.LINE_STATE, LineStatePayload, retain=True, qos=1, when=CHANGE),
    Outbound(publication.LINE_ERROR, Error, retain=True, qos=1, when=RISE),
    Outbound(publication.LINE_STATS, LineStats, retain=True, qos=0, when="30 s"),
    Outbound(
        _device(publication.STATE),
        SamplePayload,
        retain=True,
        qos=1,
        when="the newest at most every `mqtt.state_every`; a change of quality or error at once",
    ),
    Outbound(_device(publication.TELEMETRY), SamplePayload, retain=False, qos=1, when="each poll"),
    Outbound(
        _device(publication.HISTORY),
        Annotated[list[SamplePayload], Field(max_length=100)],
        retain=False,
        qos=1,
        when="samples older than 3 s; samples that a reconnect may have lost",
    ),
    Outbound(_device(publication.CONFIG), DeviceConfig, retain=True, qos=1, when=CHANGE),
    Outbound(_device(publication.AVAILABILITY), Availability, retain=True, qos=1, when=CHANGE),
    Outbound(_device(publication.ERROR), Error, retain=True, qos=1, when=RISE),
    Outbound(_device(publication.STATS), DeviceStats, retain=True, qos=0, when="30 s"),
    Outbound(
        _device(publication.WIND),
        WindPayload,
        retain=True,
        qos=1,
        when="every `wind.every`, and when a figure stops being valid; devices that measure wind",
    ),
    Outbound(
        _device(publication.RECORD),
        RecordPayload,
        retain=False,
        qos=1,
        when="at each multiple of `wind.records` of UTC; kept like a sample while the broker is away",
    ),
    Outbound(publication.EVENT, DroppedPayload | Event, retain=False, qos=1, when="as it happens"),
    Outbound("response/+/+", Response, retain=False, qos=1, when="one per request"),
    Outbound("response/+", Response, retain=False, qos=1, when="one per request of one level"),
    Outbound(publication.TRACE, TracePayload, retain=False, qos=0, when="while `line/trace` runs"),
)


def outbound(topic: str) -> Outbound:
    """Return the row of the table for a topic under `B`; raises KeyError for an unknown topic."""
    for row in OUTBOUND:
        if row.matches(topic):
            return row
    raise KeyError(topic)


def check(topic: str, text: str) -> object:
    """Return the model of an encoded payload; raises ValidationError if it does not fit.

    `text` is JSON, but for a bare word.
    """
    row = outbound(topic)
    validator = _validator(row.topic)
    return validator.validate_python(text) if row.form is Availability else validator.validate_json(text)


@cache
def _validator(pattern: str) -> TypeAdapter[object]:
    """Return the validator for the payloads of one row; building it takes milliseconds."""
    return TypeAdapter(next(row.form for row in OUTBOUND if row.topic == pattern))
