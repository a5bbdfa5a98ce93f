"""What a failed reading means and what to check on site, in words."""

from __future__ import annotations

from collections.abc import Iterator

from lfs10d.reading import FaultCode
from lfs10d.system.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Symptoms:
    """What was observed: the kind of failure, and what else the line showed.

    `echoed`: the request came back. `framing_errors` as the driver counts them, None where it does not.
    """

    code: FaultCode
    echoed: bool = False
    framing_errors: int | None = None


_SUPPLY = "Does the sensor have power? Is it the right adapter? `ls -l /dev/serial/by-id` lists the adapters."
_WIRES = "Are A and B swapped? Manufacturers label them differently; swapping them does no harm and is quick to try."
_GROUND = "Do both ends share a ground wire? Without one it may work on the bench and fail on the mast."
_TERMINATION = "One terminating resistor (120 ohm) at each end of the cable, none between, one pair of bias resistors."
_SILENCE = (_SUPPLY, _WIRES, _GROUND)

_MEANING = {
    FaultCode.TIMEOUT: "No reply: not a single byte came back.",
    FaultCode.LATE: "The reply comes, but after the time-out.",
    FaultCode.CRC: "A reply of the right length came, but its checksum is wrong.",
    FaultCode.MALFORMED: "Bytes came, but not a complete reply.",
    FaultCode.WRONG_SLAVE: "A valid frame came, but from another slave than the one polled.",
    FaultCode.WRONG_FUNCTION: "The slave replied with another function than the one requested.",
    FaultCode.COLLISION: "Another device transmits on the line.",
    FaultCode.EXCEPTION: "The device is there and understood the request, but refuses it.",
    FaultCode.OUT_OF_RANGE: "The device replies, but with an impossible value.",
    FaultCode.NOT_FINITE: "The device replies, but its value is not a number.",
    FaultCode.UNAVAILABLE: "The device replies, but reports that it has no value now.",
    FaultCode.STARTING: "The device has not been polled yet.",
    FaultCode.DISABLED: "The device is disabled in the configuration.",
    FaultCode.OVERRUN: "The poll was not made in time: the line is full.",
    FaultCode.PORT_LOST: "The serial port is missing, or access to it is denied.",
    FaultCode.PORT_BUSY: "Another program uses the serial port.",
    FaultCode.WRONG_RATE: "No device replies at this rate, but some do at another.",
    FaultCode.DUPLICATE_ID: "Two replies came to one request.",
    FaultCode.CONFIG_CONFLICT: "Two devices would have this id.",
    FaultCode.STORAGE_FULL: "The state directory cannot be written.",
    FaultCode.DUPLICATE_CLIENT: "Another client of the broker uses the same client id.",
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
    FaultCode.MALFORMED: (*_NOISE, "Does the adapter cut replies short? Wait longer: --timeout 1s."),
    FaultCode.WRONG_SLAVE: ("Is there a second master on the line? Disconnect it.", *_NOISE[:1]),
    FaultCode.WRONG_FUNCTION: ("Is it another device? `lfs10d scan` shows which profile fits.", *_NOISE[:1]),
    FaultCode.COLLISION: (
        "Is there a second master on the line? A line has exactly one.",
        "Does an adapter keep driving the line? Unplug the devices one by one.",
        _TERMINATION,
    ),
    FaultCode.EXCEPTION: ("Is it another device? `lfs10d scan` shows which profile fits, then read with --profile.",),
    FaultCode.OUT_OF_RANGE: (
        "Is it another device? `lfs10d profiles` lists the known ones.",
        "If it is not, the sensor itself may be broken: water, frost, or a worn bearing.",
    ),
    FaultCode.STARTING: ("Wait a few seconds: it is polled soon after the start.",),
    FaultCode.DISABLED: ("To poll it, set `enabled: true` in the configuration, then reload.",),
    FaultCode.OVERRUN: ("Poll less often: a longer `interval`. `lfs10d check` shows how full the line is.",),
    FaultCode.PORT_LOST: (
        "Is the adapter plugged in? `ls -l /dev/serial/by-id` lists the adapters.",
        "May this user open it? `ls -l` on the port shows its group, usually dialout.",
    ),
    FaultCode.PORT_BUSY: (
        "Is the daemon running? Stop it: `sudo systemctl stop lfs10d`.",
        "`sudo fuser -v` on the port names the program.",
    ),
    FaultCode.WRONG_RATE: ("`lfs10d scan` shows each device with its rate: use that one, or set the device.",),
    FaultCode.DUPLICATE_ID: (
        _NOISE[0],
        "Is there a repeater or a bridge that sends each reply again? Check its settings.",
    ),
    FaultCode.CONFIG_CONFLICT: ("Give one of the two another id in the configuration, then reload.",),
    FaultCode.STORAGE_FULL: (
        "Is the disk full? `df -h /var/lib/lfs10d` shows it.",
        "Has it become read-only? `dmesg` reports a worn-out SD card.",
    ),
    FaultCode.DUPLICATE_CLIENT: ("Give each client a `mqtt.client_id` of its own; a copied SD card has the old one.",),
}
_CHECKS[FaultCode.UNAVAILABLE] = (
    "Is the measuring head connected and free of ice and dirt? Some devices have no direction in a calm.",
    "Does the device have this quantity at all? Another model may lack it: see its type plate.",
)
_CHECKS[FaultCode.NOT_FINITE] = _CHECKS[FaultCode.OUT_OF_RANGE]


def meaning(seen: Symptoms) -> str:
    """Return what the symptoms mean, in a sentence or two."""
    words = _MEANING[seen.code]
    if seen.code is not FaultCode.TIMEOUT:
        return words
    if seen.framing_errors:
        count = f"{seen.framing_errors} byte{'s' * (seen.framing_errors > 1)}"
        return f"No reply, but the adapter received {count} it could not read: another baud rate, or A and B swapped."
    if seen.echoed:
        return "No reply. Only the request itself came back: the adapter echoes, which is harmless, and it does send."
    return words


def checks(seen: Symptoms) -> Iterator[str]:
    """Yield what to check, the likeliest first."""
    yield from _CHECKS[seen.code]


def lines(meant: str, advice: tuple[str, ...]) -> Iterator[str]:
    """Yield a meaning and numbered advice as lines."""
    yield meant
    if advice:
        yield ""
        yield "What to check:"
    for number, text in enumerate(advice, 1):
        yield f"  {number}. {text}"
