"""Bytes received in pieces, sorted into replies and noise."""

from __future__ import annotations

from lfs10d.modbus.echo import Echo
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.pending import Pending
from lfs10d.modbus.reception import Reception
from lfs10d.modbus.request import ReadRegisters, Request, WriteRegister
from lfs10d.modbus.timing import LineTiming
from tests.support.exchanges import Attempt

RTU, ASCII = Codec(Framing.RTU), Codec(Framing.ASCII)
WIND, WHO, MOVE = ReadRegisters(1, 0x0001, 2), ReadRegisters(1, 0x0005, 1), WriteRegister(1, 0x0005, 7)
ANSWER, REFUSED = bytes.fromhex("010304414FD70A002F"), bytes.fromhex("018302C0F1")
CONFIRMED = RTU.encode(MOVE)
REQUEST = RTU.encode(WIND)
TIMING = LineTiming.of(9600)


def reception(
    request: Request = WIND,
    *,
    echo: Echo = Echo.OFF,
    earlier: tuple[Request, ...] = (),
    codec: Codec = RTU,
    paced: bool = True,
    sent: bool = True,
) -> Reception:
    """Return the ear of an exchange whose request was begun at 0."""
    attempt = Attempt(
        request=request,
        codec=codec,
        timing=TIMING,
        timeout=0.2,
        patience=None,
        echo=echo,
        adapter_latency=0.02,
        earlier=tuple(Pending(each, codec, -0.5) for each in earlier),
        paced=paced,
    )
    ear = attempt.reception()
    if sent:
        ear.sent(0.0)
    return ear
