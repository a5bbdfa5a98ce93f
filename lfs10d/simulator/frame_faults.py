"""Replies as faults leave them: wrong though their check is right, or spoilt on the way."""

from __future__ import annotations

from collections.abc import Mapping
from random import Random
from typing import Final

from lfs10d.simulator.blueprint import READ_INPUT, WRITES
from lfs10d.simulator.faults import STRIKES_ANSWERS, STRIKES_FRAMES, ActiveFaults, FaultKind
from lfs10d.simulator.signals import READ_HOLDING
from lfs10d.simulator.wire import Framing

SPOIL: Final = (STRIKES_ANSWERS | STRIKES_FRAMES) - {FaultKind.LEADING_NOISE, FaultKind.TRAILING_NOISE}
"""Faults after which no master may believe the frame."""

_COUNT_AT: Final = 2
"""Where the byte count stands in the body of a read's reply."""


_BROKEN_FLOATS: Final[Mapping[FaultKind, int]] = {
    FaultKind.NAN: 0x7FC0_0000,
    FaultKind.INFINITE: 0x7F80_0000,
    FaultKind.OUT_OF_RANGE: 0x4974_2400,  # 1e6
    FaultKind.SUBNORMAL: 0x0000_0001,
}


def broken_float(active: ActiveFaults, name: str = "") -> int | None:
    """Return the bits of a float32 that stand in place of the value of this name, None where it is right."""
    kinds = [kind for kind in sorted(active) if kind in _BROKEN_FLOATS]
    broken = [_BROKEN_FLOATS[kind] for kind in kinds if not active[kind].values or name in active[kind].values]
    return broken[0] if broken else None


def distorted(body: bytes, active: ActiveFaults) -> bytes:
    """Return a reply's body that is wrong though its check will be right."""
    if FaultKind.WRONG_ID in active:
        wrong = active[FaultKind.WRONG_ID].value
        body = bytes(((body[0] + 1) % 256 if wrong is None else wrong,)) + body[1:]
    if FaultKind.WRONG_COUNT in active and body[1] in (READ_HOLDING, READ_INPUT):
        body = body[:2] + bytes((body[_COUNT_AT] + 2,)) + body[3:] + body[-2:]
    if FaultKind.WRONG_ECHO in active and body[1] in WRITES:
        body = body[:-1] + bytes((body[-1] ^ 1,))
    if FaultKind.WRONG_FUNCTION in active:
        body = body[:1] + bytes((body[1] ^ 0x07,)) + body[2:]
    return body


def spoilt(frame: bytes, active: ActiveFaults, random: Random, framing: Framing) -> bytes:
    """Return what of the frame comes onto the line."""
    if FaultKind.NOISY in active:
        at = random.randrange(len(frame))
        bit = 0x10 if framing == "ascii" else 1 << random.randrange(8)
        frame = frame[:at] + bytes((frame[at] ^ bit,)) + frame[at + 1 :]
    if FaultKind.GARBAGE in active:
        frame = random.randbytes(active[FaultKind.GARBAGE].length or len(frame))
    if FaultKind.TRUNCATED in active:
        frame = frame[: active[FaultKind.TRUNCATED].length or random.randrange(1, len(frame))]
    if FaultKind.LEADING_NOISE in active:
        frame = random.randbytes(active[FaultKind.LEADING_NOISE].length or 3) + frame
    if FaultKind.TRAILING_NOISE in active:
        frame += random.randbytes(active[FaultKind.TRAILING_NOISE].length or 3)
    return frame
