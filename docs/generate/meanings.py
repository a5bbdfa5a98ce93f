"""One sentence for each code, for the tables of docs/mqtt.md; what to do about it is in docs/when-it-goes-wrong.md."""

from __future__ import annotations

from typing import Final

FAULT_CODES: Final = {
    "timeout": "No reply, or nothing but the echo of the request.",
    "crc": "A reply of full length with a wrong check.",
    "malformed": "Too few bytes, another number of registers than requested, or noise.",
    "wrong_slave": "A valid frame from another slave id.",
    "wrong_function": "A valid frame with another function code.",
    "exception": "The device refused the request: see `exception_code`. It answers, so it stays online.",
    "out_of_range": "The value is outside the range of the profile, or a float32 below 1e-6. The device stays online.",
    "not_finite": "The value is NaN or infinite. The device stays online.",
    "unavailable": "The device says itself that it has no value now: the register holds what the profile names in "
    "`unavailable`. The device stays online.",
    "late": "Only the reply to an earlier request came.",
    "collision": "The line did not become silent, the bytes sent came back changed, or another master asked the same "
    "slave between the request and its reply.",
    "starting": "The daemon has not polled the device yet since its start. No error: in `state` only.",
    "disabled": "The device is disabled in the configuration. No error: published once, in one sample.",
    "overrun": "A poll was not made in time, because the line is full. Counted in the statistics only.",
    "port_lost": "The serial port is missing, access is denied, or the adapter was unplugged.",
    "port_busy": "Another program has locked the serial port.",
    "wrong_rate": "No sensor answers at the line's rate, but some do at another: the message says which.",
    "duplicate_id": "Two replies to each request: a second sensor with this id, or a repeater. In "
    "`device/<name>/error` only; samples go on, with the first reply.",
    "config_conflict": "Two devices would have one slave id: this one waits, and no value is published under its name.",
    "storage_full": "The state directory cannot be written. Polling goes on.",
    "duplicate_client": "Another client of the broker uses the same client id.",
}
"""Why a sample has no value, or what is wrong with the line (lfs10d.reading.FaultCode)."""

ERROR_CODES: Final = {
    "invalid_json": "The payload is not a JSON object, or has a key twice.",
    "invalid_param": "A parameter is wrong, unknown or missing; see `param`.",
    "unknown_request": "There is no such request; the message lists all.",
    "unknown_device": "There is no device with this name.",
    "not_allowed": "The class is not in `commands` of the configuration, or the request is never permitted here.",
    "retained": "The request was published with the retain flag. It is not carried out, and it is cleared.",
    "duplicate_conflict": "The `id` was used for another request.",
    "busy": "Another scan or physical change is under way, the device says that it is busy, or 16 repeats of the "
    "request are waiting for its end.",
    "address_in_use": "The slave id is configured or reserved, or a device answers there.",
    "duplicate_id": "Two sensors answer under one slave id.",
    "not_recognised": "The device that answers is no sensor of that profile. Nothing was written.",
    "dip_switch": "The sensor keeps its old slave id, because its DIP switch sets it.",
    "power_cycle_needed": "The sensor has stored the new setting, and will use it after a power cycle.",
    "refused": "The device refused the request: see `exception_code`.",
    "not_verified": "Not known whether it took effect: the sensor does not answer and is being searched for, or a "
    "register has another content.",
    "rolled_back": "It failed half-way, and everything was restored.",
    "line_error": "The line failed: bytes came, but no valid reply; or the port is lost or paused for another program.",
    "storage_full": "The change could not be written to disk, so it was not made.",
    "timeout": "The device did not answer.",
    "too_large": "The payload has more than 4096 bytes, or the Correlation Data more than 1024 (then not returned).",
    "rate_limited": "More than 20 requests a second.",
    "cancelled": "It was cancelled before its end.",
    "internal": "An internal error of lfs10d; see its log. Please report it.",
}
"""Why a request was not carried out (lfs10d.command.ErrorCode)."""

ADVICE: Final = {
    "invalid_json": "Send one JSON object in UTF-8; in a shell put it in single quotes.",
    "invalid_param": "Correct the parameter as the message says.",
    "unknown_request": "Use one of the names in the message.",
    "unknown_device": "Use one of the names in the message: a name, not a slave id.",
    "not_allowed": "Add the class to `commands` and reload. If the message says that it is never permitted, use the "
    "request that the message names.",
    "retained": "Publish it without the retain flag (`-r`). It is cleared already.",
    "duplicate_conflict": "Use a new `id` for every request.",
    "busy": "Wait for the end of the job in the message, or end a scan with `line/cancel`; then send it again.",
    "address_in_use": "Choose another slave id, or disconnect the device there; `line/scan` lists all devices.",
    "duplicate_id": "Disconnect one of the two, then change the slave id of the other.",
    "not_recognised": "For another kind of sensor give its `profile`. Otherwise disconnect it and try again.",
    "dip_switch": "Set the DIP switch inside the sensor to 0 and try again.",
    "power_cycle_needed": "Switch the sensor's power off and on. The daemon continues by itself.",
    "refused": "Look up `exception_code` in the device's manual; 06 means busy: try again.",
    "not_verified": "Switch the sensor's power off and on, and check the cable. The search goes on; its end is the "
    "event `readdressed` or `change_dropped`.",
    "rolled_back": "Repair the sensor that the message names, and try again.",
    "line_error": "See `line/error` and [when-it-goes-wrong.md](when-it-goes-wrong.md), then try again.",
    "storage_full": "Free space on the disk of the state directory, or make it writable, then try again.",
    "timeout": "Check connection, power, slave id and rate of the sensor; `line/scan` finds it.",
    "too_large": "Send less than 4 KiB.",
    "rate_limited": "Wait a second, and send fewer requests.",
    "cancelled": "It was cancelled by a request, or the daemon was stopped: send it again. A sensor that was "
    "written to is searched for at the next start.",
    "internal": "Report it with the log of that time.",
}
"""What to do about each of them."""
