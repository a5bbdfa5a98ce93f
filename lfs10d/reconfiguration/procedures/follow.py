"""Follows a sensor that was written to and may answer at either of two places, until it is found. Pure.

Rules
-----
1. The first look is as long as the verification of a write, for the daemon may have died right after that.
2. Then both places are read now and then, within the share of probes: after 1 s, 2 s, 4 s ... Any new answer causes
   another full look, which is reported.
3. It is over when the sensor answers at the new place and the old one is silent, or when it answers at the old one
   and its register does not hold the new id. If it does, the id may still take effect at the next power cycle.
4. A new sensor at its new place is found though a device answers at the factory's id: that is the next new sensor,
   unless the register there holds the new id too.
5. It writes in one case only: where a sensor is at the new place, one at the old place whose register holds the new
   id has its own written back. Else both would have that id after its next power-up.
"""

from __future__ import annotations

from lfs10d.line.jobs.job import Hold
from lfs10d.line.jobs.procedure import Await, Steps
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.identity_query import IdentityQuery
from lfs10d.reconfiguration.procedures.readdress import (
    QUICK_LOOK,
    ReaddressEnding,
    ReaddressFinding,
    ReaddressReport,
    judge,
    read_both,
    undo_stored_id,
    verify,
)

FIRST_PAUSE = 1.0
"""Between the first look and the first probes, in s; doubled after each."""

DECIDED = frozenset({ReaddressEnding.MOVED, ReaddressEnding.LOCKED})
"""Endings that mean that the sensor is found: at the new place, or for good at the old one."""


def follow(
    old: Endpoint,
    new: Endpoint,
    query: IdentityQuery,
    *,
    longest_pause: float,
    before: Endpoint | None = None,
    newcomer: bool = False,
) -> Steps[ReaddressReport]:
    """Read both places until the sensor is found; each round without it is awaited.

    `before` is where it was before it came to `old`: it may be there still. `newcomer`: `old` is a factory's id.
    """

    def judged(found: ReaddressFinding) -> Steps[ReaddressReport]:
        if newcomer and found.new.answers and not found.spoilt and found.old.register != new.slave:
            return ReaddressReport(ReaddressEnding.MOVED, found.new.register)
        report = yield from undo_stored_id(judge(found, None, None, new.slave), old, new.slave, query)
        if report.ending is ReaddressEnding.NOWHERE:
            return (yield from _still_there(before, new, query)) or report
        return report

    report = yield from judged((yield from verify(old, new, query, QUICK_LOOK)))
    pause = min(FIRST_PAUSE, longest_pause)
    while report.ending not in DECIDED:
        yield Await(report)
        while True:
            yield Hold(query.clock.now + pause)
            pause = min(2 * pause, longest_pause)
            at_new = yield from query.read_register(new)
            if not at_new.silent:
                break  # the full look asks the old place too, and silence is dear
            at_old = yield from query.read_register(old)
            if at_old.answers and at_old.register != new.slave:
                break
            if at_old.silent and (yield from _still_there(before, new, query)):
                break
        report = yield from judged((yield from read_both(old, new, query)))
    return report


def _still_there(before: Endpoint | None, new: Endpoint, query: IdentityQuery) -> Steps[ReaddressReport | None]:
    """Read the place of before, while the later ones are silent; return that the sensor stays there, None if not."""
    if before is None:
        return None
    reply = yield from query.read_register(before)
    return ReaddressReport(ReaddressEnding.LOCKED, reply.register) if reply.register not in (None, new.slave) else None
