"""What a failed reading means, and what to look at on the roof: words for who stands there with a screwdriver."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from lfs10d.reading import FaultCode


@dataclass(frozen=True, slots=True)
class Symptoms:
    """What was seen: the kind of failure (None: silence), and what else the line showed.

    `echoed`: our own bytes came back. `framing_errors` is what the driver counted, None where it counts nothing.
    """

    code: FaultCode
    echoed: bool = False
    framing_errors: int | None = None


_SUPPLY = "Has the sensor power? Is the right adapter meant? `ls -l /dev/serial/by-id` shows what is plugged in."
_WIRES = "Are A and B swapped? Makers do not agree on the letters: swapping them harms nothing and is quickly tried."
_GROUND = "Do both ends share a ground wire? Without one it works on the bench and fails on the mast."
_TERMINATION = "One terminating resistor (120 ohm) at each end of the cable, none between, one pair of bias resistors."
_SILENCE = (_SUPPLY, _WIRES, _GROUND)

_MEANING = {
    FaultCode.TIMEOUT: "Nobody answered: not a single byte came back.",
    FaultCode.LATE: "The answer comes, but later than it was waited for.",
    FaultCode.CRC: "Bytes came, as many as an answer has, but their check is wrong.",
    FaultCode.MALFORMED: "Bytes came, but they are no whole answer.",
    FaultCode.WRONG_SLAVE: "A right frame came, but from another slave than the one asked.",
    FaultCode.WRONG_FUNCTION: "The slave answered something else than what it was asked.",
    FaultCode.COLLISION: "Somebody else speaks on the line.",
    FaultCode.EXCEPTION: "The device is there and understood us, but refuses what was asked.",
    FaultCode.OUT_OF_RANGE: "The device answers, but with a value that cannot be.",
    FaultCode.NOT_FINITE: "The device answers, but what it says is no number.",
}

_NOISE = (
    "Do two sensors share this id? Leave only one connected and try again.",
    _TERMINATION,
    _GROUND,
)

_CHECKS = {
    FaultCode.TIMEOUT: _SILENCE,
    FaultCode.LATE: ("Wait longer: --timeout 2s. In the configuration it is the key response_timeout.",),
    FaultCode.CRC: _NOISE,
    FaultCode.MALFORMED: (*_NOISE, "Does the adapter cut answers short? Wait longer: --timeout 1s."),
    FaultCode.WRONG_SLAVE: ("Is there a second master on the line? Disconnect it.", *_NOISE[:1]),
    FaultCode.WRONG_FUNCTION: ("Is it another device? `lfs10d scan` tells which profile fits.", *_NOISE[:1]),
    FaultCode.COLLISION: (
        "Is there a second master on the line? A line has one.",
        "Does an adapter never let go of the line (its driver stays on)? Unplug the devices one by one.",
        _TERMINATION,
    ),
    FaultCode.EXCEPTION: ("Is it another device? `lfs10d scan` tells which profile fits, then read with --profile.",),
    FaultCode.OUT_OF_RANGE: (
        "Is it another device? `lfs10d profiles` lists the known ones.",
        "If it is not, the sensor itself may be broken: water, frost, or a worn bearing.",
    ),
}
_CHECKS[FaultCode.NOT_FINITE] = _CHECKS[FaultCode.OUT_OF_RANGE]


def meaning(seen: Symptoms) -> str:
    """Return what the symptoms mean, in a sentence or two."""
    words = _MEANING.get(seen.code, "The port failed.")
    if seen.code is not FaultCode.TIMEOUT:
        return words
    if seen.framing_errors:
        count = f"{seen.framing_errors} byte{'s' * (seen.framing_errors > 1)}"
        return f"Nobody answered, but the adapter saw {count} it could not read: another baud rate, or A and B swapped."
    if seen.echoed:
        return "Nobody answered. Only our own bytes came back: the adapter echoes, which is fine, and it does send."
    return words


def checks(seen: Symptoms) -> Iterator[str]:
    """Yield what to check, the likeliest first."""
    yield from _CHECKS.get(seen.code, ())


def lines(meant: str, advice: tuple[str, ...]) -> Iterator[str]:
    """Yield a meaning and numbered advice as lines."""
    yield meant
    if advice:
        yield ""
        yield "What to check:"
    for number, text in enumerate(advice, 1):
        yield f"  {number}. {text}"
