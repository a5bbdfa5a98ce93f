"""The way up: fault codes, readings, exchanges and the state of the port, as the line thread reports them.

Times are monotonic seconds of the line thread's clock; durations are seconds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from enum import StrEnum
from types import MappingProxyType
from typing import Final, Literal, Never, TypeAlias

from lfs10d.system.dataclass import dataclass

Number: TypeAlias = int | float

Value: TypeAlias = int | float | str | bool
"""The value of one quantity: a number, a text or word of its profile, or a boolean."""

NOTHING: Final[Mapping[str, Never]] = MappingProxyType({})
"""An empty mapping, one object for all that need one."""


class FaultCode(StrEnum):
    """Why there is no value; the words are the contract's."""

    TIMEOUT = "timeout"
    CRC = "crc"
    MALFORMED = "malformed"
    WRONG_SLAVE = "wrong_slave"
    WRONG_FUNCTION = "wrong_function"
    EXCEPTION = "exception"
    OUT_OF_RANGE = "out_of_range"
    NOT_FINITE = "not_finite"
    UNAVAILABLE = "unavailable"
    LATE = "late"
    COLLISION = "collision"
    STARTING = "starting"
    DISABLED = "disabled"
    OVERRUN = "overrun"
    PORT_LOST = "port_lost"
    PORT_BUSY = "port_busy"
    WRONG_RATE = "wrong_rate"
    DUPLICATE_ID = "duplicate_id"
    CONFIG_CONFLICT = "config_conflict"
    STORAGE_FULL = "storage_full"
    DUPLICATE_CLIENT = "duplicate_client"


ALIVE_CODES = frozenset({FaultCode.EXCEPTION, FaultCode.OUT_OF_RANGE, FaultCode.NOT_FINITE, FaultCode.UNAVAILABLE})
"""Faults that prove the device alive: an error, but online."""

PORT_CODES = frozenset({FaultCode.PORT_LOST, FaultCode.PORT_BUSY})
"""Faults of the port, not of the device."""

LineFaultCode: TypeAlias = Literal[
    FaultCode.PORT_LOST,
    FaultCode.PORT_BUSY,
    FaultCode.WRONG_RATE,
    FaultCode.DUPLICATE_CLIENT,
    FaultCode.STORAGE_FULL,
]
"""Errors of the line; while several are active the first of these is shown."""


@dataclass(frozen=True, slots=True)
class Fault:
    """Why an exchange or a poll failed; `message` is for people, `heard` are the bytes that came instead.

    `busy`: by the device's profile the exception says that it is busy: no error, asked again later.
    """

    code: FaultCode
    message: str
    exception_code: int | None = None
    heard: bytes = b""
    busy: bool = False


@dataclass(frozen=True, slots=True)
class Reading:
    """One finished poll (or probe) of one device, retries included: one sample.

    Exactly one of `values` and `fault` is None. Of several values some may be None: then `value_errors` says why of
    each (`unavailable`, `not_finite`, `out_of_range` or `exception`), and at least one value is there. `ages` are the
    ages in s of those values that are older than the device's interval. `at` is when the answer's last byte arrived, or
    when the poll was given up. `rtt` runs from the request's first bit to the answer's last byte; None for a failed
    poll. `online` and `response_timeout` are the device's state after this poll. `failed_attempts` are the codes of
    the attempts before the last. `overruns` counts the points of the grid missed since the reading before.
    `requests` are the numbers of the requests that asked for it. `request_gap` is the rest in s that the device is
    given between two exchanges; `gap_learned`: more than configured, because it ignored requests.
    """

    device: str
    at: float
    values: Mapping[str, Value | None] | None
    fault: Fault | None
    rtt: float | None
    online: bool
    response_timeout: float
    probe: bool = False
    failed_attempts: tuple[FaultCode, ...] = ()
    overruns: int = 0
    requests: tuple[int, ...] = ()
    request_gap: float = 0.0
    gap_learned: bool = False
    value_errors: Mapping[str, FaultCode] = field(default_factory=lambda: NOTHING)
    ages: Mapping[str, float] = field(default_factory=lambda: NOTHING)


class Purpose(StrEnum):
    """The purpose of an exchange."""

    POLL = "poll"
    PROBE = "probe"
    REQUEST = "request"
    SCAN = "scan"
    CHANGE = "change"


@dataclass(frozen=True, slots=True)
class Exchanged:
    """One exchange on the line, for statistics and traces.

    `asked` is when the line was given to it, `began` when its first byte was sent (None: never sent),
    `gap` the silence measured before that, `at` when it was over. `unsolicited` counts the bytes heard
    that were part of no answer to it, before or after the request. `late` counts dropped late answers.
    """

    at: float
    asked: float
    began: float | None
    gap: float | None
    slave: int
    purpose: Purpose
    fault: FaultCode | None
    sent: bytes
    heard: bytes
    unsolicited: int = 0
    late: int = 0


@dataclass(frozen=True, slots=True)
class UartCounters:
    """The driver's counters since it was loaded (TIOCGICOUNT)."""

    framing: int
    parity: int
    overrun: int
    breaks: int


@dataclass(frozen=True, slots=True)
class PortChanged:
    """The port was opened (`fault` None), or is lost, or lost for another reason than before.

    `freed`: nothing happened to it, we gave it back for a while.
    """

    at: float
    fault: Fault | None
    freed: bool = False


@dataclass(frozen=True, slots=True)
class UartCounted:
    """The driver's counters since this daemon first opened the port; every few seconds, if the driver counts."""

    at: float
    counters: UartCounters


@dataclass(frozen=True, slots=True)
class AnsweredTwice:
    """A device began (`fault` says how) or ceased (None) to answer each request twice.

    Its readings go on: the first answer is believed.
    """

    at: float
    device: str
    slave: int
    fault: Fault | None


Event: TypeAlias = Reading | Exchanged | PortChanged | UartCounted | AnsweredTwice


START_POLLS = 3
"""Number of polls at once that decide at the start whether a device answers."""


SILENT_CODES = frozenset({FaultCode.TIMEOUT, FaultCode.LATE, FaultCode.COLLISION, FaultCode.WRONG_SLAVE})
"""Faults after which the whole time-out was waited without an answer of the device."""
