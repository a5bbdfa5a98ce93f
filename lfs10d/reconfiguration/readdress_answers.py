"""The results of `device/readdress`: the contract's codes, and messages to the installer. Pure.

Each message says what was observed and what to do next, and names the other possible cause.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lfs10d.command import ErrorCode, Result, failed, ok, rejected
from lfs10d.profiles.profile import Profile
from lfs10d.reconfiguration.procedures.readdress import NOTHING_WRITTEN, ReaddressEnding, ReaddressReport, ReaddressWish

_ERRORS: Mapping[ReaddressEnding, tuple[ErrorCode, str]] = {
    ReaddressEnding.TAKEN: (
        "address_in_use",
        (
            "slave id {to} is in use: something answers there at {at} baud; choose another id, or identify the device: "
            "lfs10d request line/scan ids={to}"
        ),
    ),
    ReaddressEnding.ABSENT: ("timeout", "{device} does not answer at slave id {old}{refusal}; nothing was written"),
    ReaddressEnding.DEAF: (
        "line_error",
        (
            "it is not known yet whether the adapter echoes what is sent, and nothing was written; "
            "try again later, or set line.echo to on or off"
        ),
    ),
    ReaddressEnding.LOST_BEFORE: ("line_error", "the port was lost; nothing was written"),
    ReaddressEnding.UNWRITTEN: ("storage_full", "{why}; nothing was written"),
    ReaddressEnding.TWINS: (
        "duplicate_id",
        (
            "two sensors seem to have slave id {old}: {why}; nothing was written, as it would change both. Take one of "
            "them off the line. A repeater or noise looks the same; then try again"
        ),
    ),
    ReaddressEnding.UNRECOGNISED: (
        "not_recognised",
        "the device at slave id {old} is not recognised as {device}: {why}; nothing was written",
    ),
    ReaddressEnding.BOTH: (
        "duplicate_id",
        (
            "slave ids {old} and {to} both answer since the write: two sensors had id {old}, or another one came up at "
            "{to}. Take one of them off the line"
        ),
    ),
    ReaddressEnding.GARBAGE: (
        "duplicate_id",
        (
            "since the write several sensors answer at once at slave id {to}, or there is noise, and {old} is silent; "
            "take the other sensor off the line. {device} was last at {old}"
        ),
    ),
    ReaddressEnding.REFUSED: (
        "refused",
        "{device} refused the write{refusal} and stays at slave id {old}; perhaps its {lock} overrules it",
    ),
    ReaddressEnding.LOCKED: (
        "dip_switch",
        (
            "{device} stays at slave id {old}: its {lock} overrules the write; set that to 0 and try again. "
            "Or it needs its power switched off and on first"
        ),
    ),
    ReaddressEnding.PENDING: (
        "power_cycle_needed",
        (
            "{device} stored slave id {to} but still answers at {old}: switch its power off and on. "
            "If it stays at {old} then, its {lock} overrules the write"
        ),
    ),
    ReaddressEnding.NOWHERE: (
        "not_verified",
        (
            "since the write {device} answers neither at slave id {old}, where it was last, nor at {to}; "
            "both are tried until it is found"
        ),
    ),
}


def result(device: str, wish: ReaddressWish, report: ReaddressReport, profile: Profile) -> Result:
    """Return the result of `device/readdress`."""
    data: dict[str, Any] = {"device": device, "from": wish.old.slave, "to": wish.to}
    if report.ending is ReaddressEnding.MOVED:
        return ok(data)
    if report.ending is ReaddressEnding.FREE:
        return ok({**data, "dry_run": True})
    code, text = _ERRORS[report.ending]
    message = text.format(
        device=device,
        old=wish.old.slave,
        to=wish.to,
        at=report.at,
        why=report.why,
        refusal="" if report.exception is None else f" (exception {report.exception:02X})",
        lock=(profile.slave_id and profile.slave_id.locked_by) or "address switch",
    )
    facts: dict[str, Any] = {} if report.exception is None else {"exception_code": report.exception}
    if report.ending in NOTHING_WRITTEN:
        return rejected(code, message, param="to" if code == "address_in_use" else None, **facts)
    return failed(code, message, data=data, **facts)
