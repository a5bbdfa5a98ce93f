"""The results of `device/readdress`: the contract's codes, and messages to the installer. Pure.

Each message says what was observed and what to do next, and names the other possible cause.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lfs10d.command import ErrorCode, Result, failed, ok, rejected
from lfs10d.profiles.profile import Profile
from lfs10d.reconfiguration.procedures.readdress import NOTHING_WRITTEN, ReaddressEnding, ReaddressReport, ReaddressWish

CODES: Mapping[ReaddressEnding, ErrorCode] = {
    ReaddressEnding.TAKEN: "address_in_use",
    ReaddressEnding.ABSENT: "timeout",
    ReaddressEnding.DEAF: "line_error",
    ReaddressEnding.LOST_BEFORE: "line_error",
    ReaddressEnding.UNWRITTEN: "storage_full",
    ReaddressEnding.TWINS: "duplicate_id",
    ReaddressEnding.UNRECOGNISED: "not_recognised",
    ReaddressEnding.BOTH: "duplicate_id",
    ReaddressEnding.GARBAGE: "duplicate_id",
    ReaddressEnding.REFUSED: "refused",
    ReaddressEnding.LOCKED: "dip_switch",
    ReaddressEnding.PENDING: "power_cycle_needed",
    ReaddressEnding.NOWHERE: "not_verified",
}
"""The contract's code of each ending, of `line/adopt` too."""

_TEXTS: Mapping[ReaddressEnding, str] = {
    ReaddressEnding.TAKEN: (
        "slave id {to} is in use: something answers there at {at} baud; choose another id, or identify the device: "
        "lfs10d request line/scan ids={to}"
    ),
    ReaddressEnding.ABSENT: "{device} does not answer at slave id {old}{refusal}; nothing was written",
    ReaddressEnding.DEAF: (
        "it is not known yet whether the adapter echoes what is sent, and nothing was written; "
        "try again later, or set line.echo to on or off"
    ),
    ReaddressEnding.LOST_BEFORE: "the port was lost; nothing was written",
    ReaddressEnding.UNWRITTEN: "{why}; nothing was written",
    ReaddressEnding.TWINS: (
        "two sensors seem to have slave id {old}: {why}; nothing was written, as it would change both. Take one of "
        "them off the line. A repeater or noise looks the same; then try again"
    ),
    ReaddressEnding.UNRECOGNISED: (
        "the device at slave id {old} is not recognised as {device}: {why}; nothing was written"
    ),
    ReaddressEnding.BOTH: (
        "slave ids {old} and {to} both answer since the write: two sensors had id {old}, or another one came up at "
        "{to}. Take one of them off the line"
    ),
    ReaddressEnding.GARBAGE: (
        "since the write several sensors answer at once at slave id {to}, or there is noise, and {old} is silent; "
        "take the other sensor off the line. {device} was last at {old}"
    ),
    ReaddressEnding.REFUSED: (
        "{device} refused the write{refusal} and stays at slave id {old}; perhaps its {lock} overrules it"
    ),
    ReaddressEnding.LOCKED: (
        "{device} stays at slave id {old}: its {lock} overrules the write; set that to 0 and try again. "
        "Or it needs its power switched off and on first"
    ),
    ReaddressEnding.PENDING: (
        "{device} stored slave id {to} but still answers at {old}: switch its power off and on. "
        "If it stays at {old} then, its {lock} overrules the write"
    ),
    ReaddressEnding.NOWHERE: (
        "since the write {device} answers neither at slave id {old}, where it was last, nor at {to}; "
        "both are tried until it is found"
    ),
}


def result(device: str, wish: ReaddressWish, report: ReaddressReport, profile: Profile) -> Result:
    """Return the result of `device/readdress`."""
    data: dict[str, Any] = {"device": device, "from": wish.old.slave, "to": wish.to}
    if report.ending is ReaddressEnding.MOVED:
        return ok(data)
    if report.ending is ReaddressEnding.FREE:
        return ok({**data, "dry_run": True})
    written = report.ending not in NOTHING_WRITTEN
    param = "to" if report.ending is ReaddressEnding.TAKEN else None
    words = {"device": device, "old": wish.old.slave, "to": wish.to}
    return unsuccessful(report, _TEXTS, words, profile, data=data if written else None, param=param)


def unsuccessful(
    report: ReaddressReport,
    texts: Mapping[ReaddressEnding, str],
    words: Mapping[str, object],
    profile: Profile,
    *,
    data: Mapping[str, object] | None,
    param: str | None = None,
) -> Result:
    """Return the result of a change of an id that ended badly, by the text of its ending with `words` in it.

    `data` is None where nothing was written; then `param` is the parameter that is to blame.
    """
    code, exception = CODES[report.ending], report.exception
    refusal = "" if exception is None else f" (exception {exception:02X})"
    lock = (profile.slave_id and profile.slave_id.locked_by) or "address switch"
    message = texts[report.ending].format(at=report.at, why=report.why, refusal=refusal, lock=lock, **words)
    facts = {} if exception is None else {"exception_code": exception}
    if data is None:
        return rejected(code, message, param=param, **facts)
    return failed(code, message, data=data, **facts)
