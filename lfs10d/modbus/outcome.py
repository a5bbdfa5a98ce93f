"""The result of an exchange: plain values. Durations and times are seconds."""

from __future__ import annotations

from lfs10d.modbus.request import NOT_FINAL, Request
from lfs10d.reading import Fault
from lfs10d.system.dataclass import dataclass


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
