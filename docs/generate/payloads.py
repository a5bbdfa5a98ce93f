"""Models of outbound payloads, for `docs/mqtt.md` and for the tests.

The daemon builds plain dictionaries and never validates what it sends: these models say what it promises.
`docs.generate.contract` assigns them to topics.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, model_validator

from lfs10d.reading import FaultCode, Value
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry.publication import Quality

Milliseconds = Annotated[int, Field(description="epoch milliseconds, UTC")]
Count = Annotated[int, Field(ge=0, description="since boot")]
Version = Annotated[Literal[1], Field(description="version of the payload")]
Clock = Annotated[ClockState, Field(description="state of the wall clock")]
ValueFault: TypeAlias = Literal[
    FaultCode.UNAVAILABLE, FaultCode.NOT_FINITE, FaultCode.OUT_OF_RANGE, FaultCode.EXCEPTION
]
"""Faults of a single value among others."""
Errors = Annotated[dict[FaultCode, Count], Field(description="how often each failure happened")]


class Payload(BaseModel):
    """The base of all payloads: exactly these keys and types, no NaN and no Infinity."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class SamplePayload(Payload):
    """One finished poll; the values stand beside these keys under the names of the profile."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, int | float | str | bool | None]

    v: Version
    line: str
    device: str
    boot: str = Field(min_length=8, max_length=8, description="one run of the daemon, sortable by start")
    seq: int = Field(ge=0, description="from 1 per device and boot, without gaps; 0 only in the first state")
    ts: Milliseconds
    time: str = Field(pattern=r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z$", description="`ts` in ISO 8601")
    clock: Clock
    unit: str | None = Field(None, description="unit of the one value")
    units: dict[str, str] | None = Field(None, description="units by name, if there are several values")
    quality: Quality = Field(description="of the values: all are there, some, none")
    error: FaultCode | None = Field(description="why there is no value")
    rtt_ms: float | None = Field(ge=0, description="first bit of the request to last bit of the answer")
    errors: dict[str, ValueFault] | None = Field(None, description="why values are null, if quality is partial")
    ages: dict[str, Annotated[float, Field(ge=0)]] | None = Field(
        None, description="age in s of the values older than the device's interval"
    )
    historical: Literal[True] | None = Field(None, description="set on `history`")

    @property
    def values(self) -> dict[str, Value | None]:
        """The values by the profile's names."""
        return dict(self.__pydantic_extra__)

    @model_validator(mode="after")
    def _speak_with_one_voice(self) -> Self:
        """Refuse values that contradict the quality, and errors, ages and units that contradict the values."""
        values = self.values.values()
        if not self.values:
            raise ValueError("a sample has a value")
        if self.quality == "good" and (None in values or self.error is not None or self.seq == 0):
            raise ValueError("a good sample has every value, no error and a number")
        if self.quality == "bad" and (any(value is not None for value in values) or self.rtt_ms is not None):
            raise ValueError("a bad sample has neither a value nor a time of answer")
        missing = {name for name, value in self.values.items() if value is None}
        partial = self.quality == "partial"
        if partial and (self.error is not None or self.seq == 0 or len(missing) in (0, len(values))):
            raise ValueError("a partial sample has some of its values, a number, and no error")
        if (None if self.errors is None else set(self.errors)) != (missing if partial else None):
            raise ValueError("a partial sample says why of the values that it lacks, no other does")
        if not set(self.ages or ()) <= set(self.values) - missing:
            raise ValueError("only a value has an age")
        if {"unit", "units"} & self.model_fields_set != ({"unit"} if len(values) == 1 else {"units"}):
            raise ValueError("one value has a unit, several have units")
        return self


class ActiveError(Payload):
    """An active error."""

    v: Version
    active: Literal[True]
    code: FaultCode
    also: list[FaultCode] = Field(description="other codes of these failures, or other errors of the line")
    message: str = Field(description="for people")
    exception_code: int | None = Field(ge=0, le=255, description="of a Modbus exception")
    heard: str = Field(
        pattern=r"^([0-9A-F]{2}( [0-9A-F]{2}){0,31})?$", description="the last 32 bytes received, in hex"
    )
    since: Milliseconds
    last: Milliseconds
    count: int = Field(ge=1, description="failures since then")


class NoError(Payload):
    """No error."""

    v: Version
    active: Literal[False]
    code: None
    last_code: FaultCode | None = Field(description="code of the last error")
    cleared: Milliseconds | None


class Info(Payload):
    """The daemon."""

    v: Version
    version: str = Field(description="of lfs10d")
    host: str = Field(description="name of the gateway")
    boot: str = Field(description="this run of the daemon, sortable by start")
    previous_boot: str | None = Field(description="the run before; null: unknown")
    started: Milliseconds
    config_hash: str = Field(description="changes with the effective configuration")
    changes: int = Field(ge=0, description="changes made by requests that are not in the file")
    mqtt: dict[str, Any] = Field(description="protocol in use")
    features: list[str] = Field(description="optional functions of this daemon")
    clock: Clock


class DeviceEntry(Payload):
    """One polled slave."""

    name: str
    id: int = Field(ge=1, le=255, description="slave id")
    label: str | None
    profile: str
    enabled: bool
    interval: float = Field(ge=0, description="in s")


class LineStatePayload(Payload):
    """The line as it is used now."""

    v: Version
    port: str
    baudrate: int
    parity: Literal["none", "even", "odd"]
    databits: Literal[7, 8]
    stopbits: Literal[1, 2]
    framing: Literal["rtu", "ascii"]
    open: bool = Field(description="the port can be used")
    activity: str = Field(description="polling, scanning, changing_baudrate, paused ...")
    requests: Literal["ok", "denied"] = Field(
        description="denied: the broker refused the subscription to `B/request/#`"
    )


class Gaps(Payload):
    """Silence measured before our requests, in us."""

    min: float | None = Field(description="least, since boot or since the line's rate changed")
    p50: float | None = Field(description="median of the last 1000")
    p99: float | None


class Uart(Payload):
    """The driver's own counters."""

    framing: int = Field(description="stop bit missing: wrong rate, A and B swapped, noise")
    parity: int = Field(description="parity bit wrong")
    overrun: int = Field(description="bytes lost in the adapter or the kernel")
    break_: int = Field(alias="break", description="line held low for longer than a character")


class StoreStats(Payload):
    """Samples that wait for the broker."""

    depth: int = Field(ge=0, description="samples")
    oldest_ts: Milliseconds | None
    dropped: Count


class LineStats(Payload):
    """The line's figures; rates are of the last 30 s."""

    v: Version
    ts: Milliseconds
    load_pct: float | None = Field(ge=0, le=100, description="percent of the time in which the line is in use")
    polls_per_s: float | None = Field(ge=0, description="good and failed polls")
    cycle_s: float | None = Field(ge=0, description="longest time between two polls of one device")
    gap_required_us: float = Field(description="silence kept before each request")
    gap_us: Gaps = Field(description="silence measured before requests")
    exchanges: Count
    errors: Errors
    unsolicited_bytes: int = Field(ge=0, description="received and part of no answer, since boot")
    uart: Uart | None = Field(description="errors counted by the driver; null: it does not count")
    store: StoreStats = Field(description="samples waiting for the broker")


class Calibrated(Payload):
    """A value's calibration: `value * scale + offset`."""

    scale: float
    offset: float = Field(description="in the value's unit")


class DeviceConfig(Payload):
    """How a device is polled."""

    v: Version
    slave: int = Field(ge=1, le=255, description="slave id")
    label: str | None
    profile: str
    interval: float = Field(ge=0, description="in s")
    enabled: bool
    response_timeout: float | Literal["auto"] = Field(description="in s; auto: learned")
    request_gap: float = Field(ge=0, description="rest before each request to it in s, as set or learned")
    calibration: dict[str, Calibrated] = Field(
        description="scale and offset of its calibration certificate by value name; {}: none"
    )


class RoundTrip(Payload):
    """Times of answers in ms, of the last 100."""

    p50: float | None
    p95: float | None


class DeviceStats(Payload):
    """A device's figures."""

    v: Version
    ts: Milliseconds
    polls: Count
    good: Count
    partial: int = Field(ge=0, description="those among `good` that lacked values, since boot")
    errors: Errors
    rtt_ms: RoundTrip = Field(description="from request to answer, of its last 100 answers")
    response_timeout_ms: float | None = Field(description="as set or learned")
    request_gap_ms: float = Field(ge=0, description="rest before each request to it, as set or learned")
    last_good_ts: Milliseconds | None


class Event(Payload):
    """Something that happened once; each type has keys of its own."""

    model_config = ConfigDict(extra="allow")

    v: Version
    type: str
    ts: Milliseconds

    @model_validator(mode="after")
    def _leave_dropped_alone(self) -> Self:
        """Refuse the type `dropped`, which has a model of its own."""
        if self.type == "dropped":
            raise ValueError("dropped has facts of its own")
        return self


class DroppedPayload(Payload):
    """Samples, or records, of one device that are lost, within `from_seq`..`to_seq` both included."""

    v: Version
    type: Literal["dropped"]
    ts: Milliseconds
    device: str
    boot: str
    from_seq: int
    to_seq: int
    count: int
    topic: Literal["record"] | None = Field(None, description="set where records are lost")


class RequestError(Payload):
    """Why a request was not carried out."""

    code: str = Field(description="see below")
    message: str = Field(description="for people")
    param: str | None = Field(None, description="the parameter that is wrong")
    exception_code: int | None = Field(None, description="of a sensor's Modbus exception")


class Response(Payload):
    """The response to a request."""

    v: Version
    id: str | int | None = Field(description="as in the request")
    transaction: str | int | None = Field(None, description="as in the request, if it had one")
    request: str | None = Field(description="its name")
    status: Literal["ok", "rejected", "failed"] = Field(
        description="rejected: no write was sent and nothing changed; failed: a write may have been sent"
    )
    data: Any = Field(description="the result")
    error: RequestError | None
    took_ms: float = Field(ge=0, description="from its arrival to this response")


class TracePayload(Payload):
    """One frame on the line."""

    v: Version
    ts: Milliseconds
    direction: Literal["tx", "rx"] = Field(description="tx: sent by the daemon")
    gap_us: float | None = Field(description="silence before it")
    hex: str = Field(description="its bytes")
    text: str = Field(description="its meaning, for people")


Error: TypeAlias = ActiveError | NoError
Availability: TypeAlias = Literal["online", "offline"]
