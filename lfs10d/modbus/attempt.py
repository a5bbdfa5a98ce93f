"""What an exchange is told and what it tells: plain values. Callers import them from `lfs10d.modbus.exchange`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple, TypeAlias

from lfs10d.modbus.frames import Codec, Request
from lfs10d.modbus.request import NOT_FINAL
from lfs10d.modbus.timing import LineTiming
from lfs10d.reading import Fault


class Echo(StrEnum):
    """Whether the adapter returns our own bytes."""

    ON = "on"
    OFF = "off"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Pending:
    """An unanswered earlier request, whose answer may still come; `sent_end` is its last bit.

    `ours`: we asked it, no other master did.
    """

    request: Request
    codec: Codec
    sent_end: float
    ours: bool = True


@dataclass(frozen=True, slots=True)
class Attempt:
    """One request to be put on the line, and all that its exchange must know. Durations are seconds.

    `timeout` runs from the last bit of the request to the first byte of the answer; `patience` is the slave's
    learned p99 of the same (None: not learned). `adapter_latency` is the longest pause that the adapter may put
    into one answer. `earlier` are the requests to this slave whose answers may still come, the oldest first,
    `elsewhere` those to any slave, by slave id. `turn` is how long to wait for
    silence before giving up; `turnaround_delay` the silence after a broadcast. `gap` is the required silence
    where it is longer than the timing's (a change of rate). `echo_proved`: that the adapter has no echo was observed,
    not only configured. `paced`: the port is a real wire, on which nothing
    arrives sooner than the rate allows (not so on a pseudo terminal or behind a network bridge).
    """

    request: Request
    codec: Codec
    timing: LineTiming
    timeout: float
    patience: float | None
    echo: Echo
    adapter_latency: float
    earlier: tuple[Pending, ...]
    turn: float
    turnaround_delay: float = 0.1
    gap: float | None = None
    paced: bool = False
    echo_proved: bool = False
    elsewhere: Mapping[int, tuple[Pending, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class LateAnswer:
    """An answer to an earlier request; `latency` runs from that request's last bit to its first byte."""

    request: Request
    latency: float
    ours: bool = True


@dataclass(frozen=True, slots=True)
class Outcome:
    """How an exchange ended. Exactly one of `answer` and `fault` is None; times are None where nothing was sent.

    `answer` holds the registers read, the value confirmed by a write, nothing after a broadcast. `gap` is the
    silence before the request (None also where it was never measured), `ended` the last byte of the answer or
    the time of giving up, `turnaround` from the request's last bit to the answer's first byte, `rtt` from the
    request's first bit to the answer's last byte. `answered`: bytes came that begin as this request's answer.
    `echoed`: whether our own bytes came back, None without evidence. `heard` is what came after the request (the
    last of it where there was much), before it where nothing was sent. `unsolicited` counts the bytes that belong
    to no answer, earlier ones included. `quiet_since` is the last byte sent or heard. `ambiguous`: the answer or
    exception may be that of another request in `earlier`: the slave is not proved to be synchronised. `strays` is what
    belongs to no echo and to no answer, in order, each piece with the time at which it was read.
    """

    request: Request
    answer: tuple[int, ...] | None
    fault: Fault | None
    asked: float
    began: float | None
    sent_end: float | None
    gap: float | None
    ended: float
    turnaround: float | None
    rtt: float | None
    answered: bool
    late: tuple[LateAnswer, ...]
    echoed: bool | None
    sent: bytes
    heard: bytes
    unsolicited: int
    quiet_since: float
    ambiguous: bool = False
    strays: tuple[tuple[bytes, float], ...] = ()

    @property
    def may_follow(self) -> bool:
        """Whether the answer may still come though an exception did (05, 0A, 0B)."""
        return self.fault is not None and self.fault.exception_code in NOT_FINAL


class Quiet(NamedTuple):
    """Let the line be silent: call `step` again at `until`, or when bytes have been given to `received`."""

    until: float


class Send(NamedTuple):
    """Look once more whether bytes wait; if none do, write `frame` at once and tell it by `sent`."""

    frame: bytes


class Listen(NamedTuple):
    """Read what comes and give it to `received`; call `step` after that, or at `until`.

    Nothing can be decided on new bytes before `not_before`, so the caller may sleep to it. At `until` what is
    there must be read before `step` is called.
    """

    until: float
    not_before: float


class Settled(NamedTuple):
    """The exchange is over."""

    outcome: Outcome


Decision: TypeAlias = Quiet | Send | Listen | Settled
