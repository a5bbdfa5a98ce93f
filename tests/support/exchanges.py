"""What the tests of the exchange share: an attempt, bytes for it, and the shell that carries it out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from lfs10d.modbus.ask import Ask, LineContext
from lfs10d.modbus.echo import Echo
from lfs10d.modbus.exchange import Exchange, Listen, Quiet, Send, Settled
from lfs10d.modbus.frames import Checksum, Codec, Framing
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.pending import Pending
from lfs10d.modbus.reception import Reception
from lfs10d.modbus.request import ReadRegisters, WriteRegister
from lfs10d.modbus.timing import LineTiming
from lfs10d.reading import FaultCode

RTU, SUM, ASCII = Codec(Framing.RTU), Codec(Framing.RTU, Checksum.SUM), Codec(Framing.ASCII)
T9600 = LineTiming.of(9600)
CHARACTER = T9600.character
WIND = ReadRegisters(1, 0x0001, 2)
WHO = ReadRegisters(1, 0x0005, 1)
MOVE = WriteRegister(1, 0x0005, 7)
ANSWER = bytes.fromhex("010304414FD70A002F")
VALUES = (0x414F, 0xD70A)
BROKEN = bytes.fromhex("010304414FD70A0030")
REFUSED = bytes.fromhex("018302C0F1")
SENT_END = 8 * CHARACTER
"""Of an RTU request begun at 0 and written in no time."""
HUSH = T9600.t35 + 0.004


@dataclass(frozen=True)
class Attempt:
    """All that one exchange is given, side by side, so that a test replaces what it means."""

    request: ReadRegisters | WriteRegister
    codec: Codec
    timing: LineTiming = T9600
    timeout: float = 0.2
    patience: float | None = None
    echo: Echo = Echo.OFF
    adapter_latency: float = 0.02
    earlier: tuple[Pending, ...] = ()
    elsewhere: Mapping[int, tuple[Pending, ...]] = field(default_factory=dict)
    gap: float | None = None
    paced: bool = True
    echo_proved: bool = False

    @property
    def ask(self) -> Ask:
        return Ask(self.request, self.codec, self.timeout, self.patience)

    @property
    def line(self) -> LineContext:
        return LineContext(
            self.timing,
            self.echo,
            self.adapter_latency,
            gap=self.gap,
            paced=self.paced,
            echo_proved=self.echo_proved,
        )

    @property
    def pending(self) -> Mapping[int, tuple[Pending, ...]]:
        return {self.request.slave: self.earlier, **self.elsewhere}

    def exchange(self, *, asked: float = 0.0, quiet_since: float = -1.0) -> Exchange:
        return Exchange(self.ask, self.line, self.pending, asked=asked, quiet_since=quiet_since)

    def reception(self, frame: bytes | None = None) -> Reception:
        sent = self.codec.encode(self.request) if frame is None else frame
        return Reception(self.ask, self.line, self.pending, sent, self.codec.shapes(self.request))


def framed(body: str, codec: Codec = RTU) -> bytes:
    return codec.wrap(bytes.fromhex(body))


def attempt(request: ReadRegisters | WriteRegister = WIND, codec: Codec = RTU) -> Attempt:
    """Return an attempt with a time-out of 200 ms, a learned turnaround of 30 ms and an adapter without echo."""
    return Attempt(
        request=request,
        codec=codec,
        timing=T9600,
        timeout=0.2,
        patience=0.03,
        echo=Echo.OFF,
        adapter_latency=0.004,
    )


PLAIN = attempt()
ECHOING = replace(PLAIN, echo=Echo.ON)
UNKNOWN = replace(PLAIN, echo=Echo.UNKNOWN)
REQUEST = RTU.encode(WIND)
LATE = framed("0103020007")
"""The answer to `WHO`, which the exchange of `WIND` may still hear."""
CONFIRMED = framed("010600050007")
"""The answer to `MOVE`."""


def byte_by_byte(data: bytes, begin: float) -> list[tuple[float, bytes]]:
    """Return the bytes of a frame, each when its last bit has come."""
    return [(begin + (i + 1) * CHARACTER, data[i : i + 1]) for i in range(len(data))]


def carry_out(
    each: Attempt,
    arrivals: list[tuple[float, bytes]],
    *,
    asked: float = 0.0,
    quiet_since: float = -1.0,
    keeps: bool = True,
) -> Outcome:
    """Obey an exchange as the bus does: sleep, read what is there, step; it `keeps` a plain beginning for later."""
    exchange = each.exchange(asked=asked, quiet_since=quiet_since)
    waiting = sorted(arrivals, key=lambda arrival: arrival[0])
    now, kept = asked, None
    while True:
        there = b"".join(data for at, data in waiting if at <= now)
        waiting = [arrival for arrival in waiting if arrival[0] > now]
        begun = exchange.foreseen(there, now) if keeps and there and kept is None else None
        if begun is not None:
            kept = there, now
        elif kept is not None and not there:
            exchange.received(*kept)
            kept = None
        else:
            exchange.received(there, now, kept)
            kept = None
        match begun or exchange.step(now):
            case Settled(outcome):
                return outcome
            case Send():
                exchange.sent(now, now)
            case Quiet(until):
                now = min([until, *(at for at, _ in waiting)])
            case Listen(until, not_before):
                now = min([until, *(max(at, not_before) for at, _ in waiting)])


def code(outcome: Outcome) -> FaultCode | None:
    assert (outcome.answer is None) is (outcome.fault is not None)
    return outcome.fault.code if outcome.fault else None


def listening(each: Attempt = PLAIN) -> Exchange:
    """Return an exchange whose request was begun at 0 and written in no time."""
    exchange = each.exchange()
    assert exchange.step(0.0) == Send(each.codec.encode(each.request))
    exchange.sent(0.0, 0.0)
    return exchange
