"""The meaning of each code and what to do about it, for viewers of the page. Pure.

The long form is docs/when-it-goes-wrong.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from lfs10d.cli.render.foreign import mapping

_WIRING: Final = "Check power, the plug, and the wires A and B from the last sensor that answers to this one."

MEANINGS: Final[Mapping[str, tuple[str, str]]] = {
    "timeout": ("does not answer", _WIRING),
    "crc": ("answers are garbled", "Check termination, ground and shield; two sensors with one id look like this too."),
    "malformed": ("answers are incomplete", "Check the line for noise and loose wires; two sensors may share this id."),
    "wrong_slave": ("another slave answers", "Look for two devices with one id, or a second master on the line."),
    "wrong_function": ("answers something else", "Is this the right profile for the device? Look for a second master."),
    "exception": ("refuses the request", "The device is there. Is this the right profile for it?"),
    "out_of_range": ("measures an impossible value", "The device answers. Look at the sensor itself, or its profile."),
    "not_finite": ("has no number to give", "The device answers. Look at the sensor itself."),
    "unavailable": (
        "has no value now",
        "The device answers. It may be warming up, or the part for this value is absent.",
    ),
    "late": ("answers too late", "Set a longer response_timeout for it."),
    "collision": ("the line is never silent", "Another device transmits. Look for a second master on the line."),
    "starting": ("not polled yet", "Wait a moment: the daemon has just started."),
    "disabled": ("is disabled", "Enable it to poll it again."),
    "overrun": ("is polled too seldom", "The line is full: use a longer interval or a higher baud rate."),
    "port_lost": ("the serial port is missing", "Plug the adapter in again; check its name and its permissions."),
    "port_busy": ("another program has the serial port", "End the other program, or use `line/pause` beforehand."),
    "wrong_rate": ("the sensors use another baud rate", "Set the line to the rate that the message names."),
    "config_conflict": ("two devices would have one id", "Give one of them another id in the configuration."),
    "duplicate_id": ("two devices answer under this id", "Disconnect one of them, then give the other another id."),
    "storage_full": ("the disk cannot be written", "Make room on the disk of the gateway; polling goes on."),
    "duplicate_client": ("another MQTT client uses the same id", "Give each daemon a client id of its own."),
    "invalid_param": ("a value is wrong", "Correct what the message names."),
    "unknown_device": ("there is no such device", "It may have been renamed or removed: load the page again."),
    "not_allowed": (
        "the daemon does not permit it",
        "Add the class of the request to `commands` in the configuration.",
    ),
    "busy": ("another job is under way", "Wait for its end, or cancel the scan; then try again."),
    "address_in_use": ("that slave id is taken", "Choose another id; a scan shows which devices are there."),
    "not_recognised": ("the device is no sensor of that profile", "Nothing was written. Choose the right profile."),
    "dip_switch": ("its DIP switch sets the id", "Set the id with the switch inside the sensor."),
    "power_cycle_needed": ("stored, but not in use yet", "Disconnect the sensor from power for a moment."),
    "refused": ("the device refused it", "Is this the right profile for the device?"),
    "not_verified": ("not known whether it took effect", "The daemon looks for the sensor; wait, or check its wires."),
    "rolled_back": ("failed half-way; everything is as before", "Look at the line, then try again."),
    "line_error": ("the line failed", "Look at the errors of the line and the sensor, then try again."),
    "rate_limited": ("too many requests", "Wait a second, then try again."),
    "cancelled": ("it was cancelled", "Start it again when you are ready."),
    "internal": ("an internal error of lfs10d", "See the log of the daemon, and please report it."),
}
"""Code: what it means, and what to do."""


def meaning(code: object) -> str:
    """Return the meaning of a code; the code itself if it is unknown."""
    return MEANINGS[code][0] if isinstance(code, str) and code in MEANINGS else str(code)


def remedy(code: object) -> str:
    """Return what to do about a code; empty if it is unknown."""
    return MEANINGS[code][1] if isinstance(code, str) and code in MEANINGS else ""


def explained(error: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return an active error object with `meaning` and `remedy`; None where there is no active error."""
    if error is None or error.get("active") is not True:
        return None
    code = error.get("code")
    keys = ("code", "message", "since", "last", "count", "heard", "also", "exception_code")
    return {key: error.get(key) for key in keys} | {"meaning": meaning(code), "remedy": remedy(code)}


def answer(response: Mapping[str, Any]) -> str:
    """Return the response to a request in words."""
    if response.get("status") == "ok":
        return "Done."
    error = mapping(response.get("error"))
    code, message = error.get("code"), error.get("message")
    outcome = "Nothing was changed" if response.get("status") == "rejected" else "It failed"
    parts = [
        f"{outcome}: {meaning(code)}.",
        f"{message[0].upper()}{message[1:]}." if isinstance(message, str) and message else "",
        remedy(code),
    ]
    return " ".join(part for part in parts if part).replace("..", ".")
