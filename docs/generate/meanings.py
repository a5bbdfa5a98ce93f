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
    "out_of_range": "The value is beyond what the profile believes. The device is alive.",
    "not_finite": "The value is NaN or infinite. The device is alive.",
    "late": "Only the answer to an earlier request came.",
    "collision": "The line never fell silent for us, or our own bytes came back changed.",
    "disabled": "The device is switched off in the configuration. Not an error: said once, in one sample.",
    "overrun": "A poll was not made in time: the line is full. Counted only, in the statistics.",
    "port_lost": "The serial port is absent, denied or hung up.",
    "port_busy": "Another program has locked the serial port.",
    "config_conflict": "Two devices would have one id: this one waits, and no value is published under its name.",
    "storage_full": "The state directory cannot be written. Measuring goes on.",
    "duplicate_client": "Another client at the broker uses our client id.",
}
"""Why a sample has no value, or what ails the line (lfs10d.reading.FaultCode)."""

ERROR_CODES: Final = {
    "invalid_json": "The payload is no JSON object.",
    "invalid_param": "A parameter is wrong, unknown or missing: `param` names it.",
    "unknown_request": "There is no such request; the message lists those there are.",
    "unknown_device": "No device has this name.",
    "not_allowed": "`commands` in the configuration leaves this class out, or it is never permitted here.",
    "retained": "It was published with the retain flag. It is not executed, and it is cleared.",
    "duplicate_conflict": "The `id` was used for another request.",
    "busy": "Another scan or physical change is under way, or the device says itself that it is busy.",
    "address_in_use": "The slave id is configured, reserved, or somebody answers there.",
    "duplicate_id": "Two sensors answer under one id now.",
    "dip_switch": "The sensor stays at its old id: its DIP switch rules.",
    "power_cycle_needed": "The sensor has stored the new setting, and uses it after its power is switched off and on.",
    "refused": "The device refused what was asked: `exception_code` says why.",
    "not_verified": "It is not known to have taken: the sensor answers nowhere and is being looked for, or a register "
    "holds something else.",
    "rolled_back": "It failed half-way, and all is as it was before.",
    "line_error": "The line failed: bytes came, but no right answer.",
    "storage_full": "The change could not be written to the disk, so it was not made.",
    "timeout": "The device did not answer.",
    "too_large": "The payload has more than 4096 bytes.",
    "rate_limited": "More than 20 requests a second.",
    "cancelled": "It was ended before its end.",
    "internal": "A fault of lfs10d itself; its log says more. Please report it.",
}
"""Why a request was not carried out (lfs10d.commands.ErrorCode)."""
