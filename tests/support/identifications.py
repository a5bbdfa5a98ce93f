"""An identification and the outcomes it is given."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from lfs10d.line.jobs.identification import (
    FoundDevice,
    Identification,
    by_evidence,
)
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import ReadRegisters
from lfs10d.profiles.library import builtin_names, load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Fault, FaultCode
from tests.support.outcomes import ended

CODEC = Codec(Framing.RTU)
BUILTIN = {name: load_profile(name, relative_to=Path()) for name in builtin_names()}
PROFILES = by_evidence(BUILTIN.values())
LFS10, LD_E, FULING, EH600 = (BUILTIN[name] for name in ("lfs10", "ld-e", "fuling-dzb", "eh600"))
WIND = (0x414F, 0xD70A)
"""12.99 m/s."""


def outcome(
    request: ReadRegisters,
    answer: tuple[int, ...] | None = None,
    code: FaultCode = FaultCode.TIMEOUT,
    *,
    exception: int | None = None,
    heard: bytes = b"",
    unsolicited: int = 0,
    ambiguous: bool = False,
    rtt: float | None = 0.02,
) -> Outcome:
    """Return how an exchange ended: with an answer, an exception, or the fault `code`."""
    fault = None
    if exception is not None:
        fault = Fault(FaultCode.EXCEPTION, "refused", exception)
    elif answer is None:
        fault, rtt = Fault(code, "failed", heard=heard), None
    return ended(
        request,
        answer=answer,
        fault=fault,
        rtt=rtt,
        answered=fault is None,
        sent=CODEC.encode(request),
        heard=heard,
        unsolicited=unsolicited,
        ambiguous=ambiguous,
    )


def identify(
    device: Callable[[ReadRegisters], Outcome],
    *,
    slave: int = 3,
    profiles: Sequence[Profile] = PROFILES,
    first: Outcome | None = None,
) -> tuple[FoundDevice | None, list[ReadRegisters]]:
    """Identify a device; return what was found, and what was asked."""
    asked: list[ReadRegisters] = []
    steps = Identification(FoundDevice(slave, 9600), profiles, CODEC, first).steps()
    try:
        request = next(steps)
        while True:
            asked.append(request)
            request = steps.send(device(request))
    except StopIteration as end:
        return end.value, asked


def registers(content: dict[int, int]) -> Callable[[ReadRegisters], Outcome]:
    """Return a device that has these registers and refuses others."""

    def device(request: ReadRegisters) -> Outcome:
        wanted = range(request.address, request.address + request.count)
        if all(register in content for register in wanted):
            return outcome(request, tuple(content[register] for register in wanted))
        return outcome(request, exception=2)

    return device


def lfs10(slave: int = 3, wind: tuple[int, int] = WIND) -> Callable[[ReadRegisters], Outcome]:
    return registers({1: wind[0], 2: wind[1], 4: 1, 5: slave})


def garbled(times: Sequence[bool]) -> Callable[[ReadRegisters], Outcome]:
    """Return an LFS10 whose value is garbled in these of the reads."""
    garbles = iter(times)

    def device(request: ReadRegisters) -> Outcome:
        if request.address == 1 and next(garbles):
            return outcome(request, code=FaultCode.CRC, heard=b"\x03\x03\x04garbled", unsolicited=0)
        return lfs10()(request)

    return device
