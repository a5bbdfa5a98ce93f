"""One sentence for each code, for the tables of docs/mqtt.md; what to do about it is in docs/when-it-goes-wrong.md."""

from __future__ import annotations

from typing import Final

FAULT_CODES: Final = {
    "timeout": "No answer came, or nothing but our own echo.",
    "crc": "An answer of full length came, and its check is wrong.",
    "malformed": "Fewer bytes than an answer has, another count than asked for, or noise.",
    "wrong_slave": "A right frame came, from another slave id.",
    "wrong_function": "A right frame came, for another function.",
    "exception": "The device refused: `exception_code` says why. It is alive, so it stays online.",
    "out_of_range": "The value is beyond what the profile believes, or a float32 below 1e-6. The device is alive.",
    "not_finite": "The value is NaN or infinite. The device is alive.",
    "late": "Only the answer to an earlier request came.",
    "collision": "The line never fell silent for us, our own bytes came back changed, or another master asked the same "
    "slave between our request and its answer.",
    "starting": "The daemon has just started and has not polled the device yet. No error: it is in no error topic.",
    "disabled": "The device is switched off in the configuration. Not an error: said once, in one sample.",
    "overrun": "A poll was not made in time: the line is full. Counted only, in the statistics.",
    "port_lost": "The serial port is absent, denied or hung up.",
    "port_busy": "Another program has locked the serial port.",
    "wrong_rate": "No sensor answers at the line's rate, but some do at another: the message says at which.",
    "duplicate_id": "Two answers come to each request: a second sensor with this id, or a repeater. In "
    "`device/<name>/error` only; the samples go on, with the answer that comes first.",
    "config_conflict": "Two devices would have one id: this one waits, and no value is published under its name.",
    "storage_full": "The state directory cannot be written. Measuring goes on.",
    "duplicate_client": "Another client at the broker uses our client id.",
}
"""Why a sample has no value, or what ails the line (lfs10d.reading.FaultCode)."""

ERROR_CODES: Final = {
    "invalid_json": "The payload is no JSON object, or gives a key twice.",
    "invalid_param": "A parameter is wrong, unknown or missing: `param` names it.",
    "unknown_request": "There is no such request; the message lists those there are.",
    "unknown_device": "No device has this name.",
    "not_allowed": "`commands` in the configuration leaves this class out, or it is never permitted here.",
    "retained": "It was published with the retain flag. It is not executed, and it is cleared.",
    "duplicate_conflict": "The `id` was used for another request.",
    "busy": "Another scan or physical change is under way, the device says that it is busy, or 16 repeats of the "
    "request wait for its end already.",
    "address_in_use": "The slave id is configured, reserved, or somebody answers there.",
    "duplicate_id": "Two sensors answer under one id now, or did before anything was written.",
    "not_recognised": "What answers is no sensor of that profile; nothing was written.",
    "dip_switch": "The sensor stays at its old id: its DIP switch rules.",
    "power_cycle_needed": "The sensor has stored the new setting, and uses it after its power is switched off and on.",
    "refused": "The device refused what was asked: `exception_code` says why.",
    "not_verified": "It is not known to have taken: the sensor answers nowhere and is being looked for, or a register "
    "holds something else.",
    "rolled_back": "It failed half-way, and all is as it was before.",
    "line_error": "The line failed: bytes came, but no right answer.",
    "storage_full": "The change could not be written to the disk, so it was not made.",
    "timeout": "The device did not answer.",
    "too_large": "The payload has more than 4096 bytes, or the Correlation Data more than 1024 (then not returned).",
    "rate_limited": "More than 20 requests a second.",
    "cancelled": "It was ended before its end.",
    "internal": "A fault of lfs10d itself; its log says more. Please report it.",
}
"""Why a request was not carried out (lfs10d.command.ErrorCode)."""

ADVICE: Final = {
    "invalid_json": "Send one JSON object in UTF-8; in a shell put it in single quotes.",
    "invalid_param": "Correct what the message says of `param`.",
    "unknown_request": "Take one of the names in the message.",
    "unknown_device": "Take one of the names in the message: a name, not an id.",
    "not_allowed": "Add the class to `commands` and reload. Where the message says that it is never permitted, use the "
    "request that it names.",
    "retained": "Publish it without the retain flag (`-r`). It is cleared already.",
    "duplicate_conflict": "Give every request an `id` of its own.",
    "busy": "Wait for the end of what the message names, or end a scan by `line/cancel`; then send it again.",
    "address_in_use": "Choose another id, or take the stranger there off the line; `line/scan` tells who is where.",
    "duplicate_id": "Take one of the two off the line, then re-address the other.",
    "not_recognised": "Another kind of sensor: name its profile. Else take it off the line and ask again.",
    "dip_switch": "Set the DIP switch inside the sensor to 0 and ask again.",
    "power_cycle_needed": "Switch the sensor's power off and on. The daemon notices when it comes up.",
    "refused": "Look up `exception_code` in the device's manual; 06 means busy, so ask again.",
    "not_verified": "Switch the sensor's power off and on, and look at the cable. It is being looked for; event "
    "`readdressed` or `change_dropped` tells the end.",
    "rolled_back": "Nothing is lost. The message names the sensor that failed: see to it, and ask again.",
    "line_error": "See `line/error` and [when-it-goes-wrong.md](when-it-goes-wrong.md), and ask again.",
    "storage_full": "Make room on the disk of the state directory, or make it writable, and ask again.",
    "timeout": "Is the sensor connected, powered, at this id and rate? `line/scan` finds it.",
    "too_large": "Send less than 4 KiB.",
    "rate_limited": "Wait a second, and send fewer.",
    "cancelled": "Somebody ended it, or the daemon was ending: ask again. A sensor that was written to is looked for "
    "at the next start.",
    "internal": "Report it with the log of that moment.",
}
"""What a person does about each of them."""
