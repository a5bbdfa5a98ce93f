"""The results of `line/baudrate`: the contract's codes, and messages to the installer. Pure.

Each message says what was observed and what to do next.
"""

from __future__ import annotations

from collections.abc import Mapping

from lfs10d.command import ErrorCode, Result, failed, ok, rejected
from lfs10d.reconfiguration.procedures.baudrate import UNTOUCHED, BaudrateEnding, BaudrateReport

_ERRORS: Mapping[BaudrateEnding, tuple[ErrorCode, str]] = {
    BaudrateEnding.ABSENT: (
        "timeout",
        "nothing was written: {names} does not answer. Every sensor must answer first, or it would be lost",
    ),
    BaudrateEnding.DEAF: (
        "line_error",
        (
            "it is not known yet whether the adapter echoes what is sent, and nothing was written; "
            "try again later, or set line.echo to on or off"
        ),
    ),
    BaudrateEnding.LOST_BEFORE: ("line_error", "the port was lost; nothing was written"),
    BaudrateEnding.UNWRITTEN: ("storage_full", "{why}; nothing was written"),
    BaudrateEnding.REFUSED: ("refused", "{names} refused the write{refusal}; everything is as it was, at {old} baud"),
    BaudrateEnding.CANARY: (
        "power_cycle_needed",
        (
            "{names} accepted the rate but still answers at {old} baud, so the write was undone and no other sensor "
            "was changed. Ask again with power_cycle true, then switch the power of all sensors off and on. Or its "
            "setting is locked by a switch"
        ),
    ),
    BaudrateEnding.TWINS: (
        "duplicate_id",
        (
            "since the write {names} answers at {old} and at {to} baud: two sensors have its slave id; take one of "
            "them off the line. All are at {old} again"
        ),
    ),
    BaudrateEnding.ROLLED_BACK: (
        "rolled_back",
        "not every sensor answered at {to} baud after the write; all are at {old} again",
    ),
    BaudrateEnding.UNVERIFIED: (
        "not_verified",
        "{names} no longer answers; it was last seen at {old} baud, and is queried at {old} and {to} until it is found",
    ),
}


def result(old: int, to: int, report: BaudrateReport, *, dry_run: bool = False) -> Result:
    """Return the result of `line/baudrate` from the rate `old` to the rate `to`."""
    if report.ended in (BaudrateEnding.MOVED, BaudrateEnding.PENDING):
        return ok({"from": old, "to": to, "pending": list(report.names)})
    if report.ended is BaudrateEnding.FREE:
        return ok({"from": old, "to": to, "dry_run": dry_run})
    code, text = _ERRORS[report.ended]
    refusal = "" if report.exception is None else f" (exception {report.exception:02X})"
    message = text.format(names=", ".join(report.names), old=old, to=to, why=report.why, refusal=refusal)
    if report.ended in UNTOUCHED:
        return rejected(code, message)
    facts = {} if report.exception is None else {"exception_code": report.exception}
    return failed(code, message, data={"where": dict(report.where)}, **facts)
