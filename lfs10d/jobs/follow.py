"""Following a sensor that was written to and may answer at either of two places, until it is found. Pure; it reads.

Rules
-----
1. The first look is as patient as the verification of a write, for the daemon may have died right after that.
2. Then both places are asked now and then, within the share of probes: after 1 s, 2 s, 4 s ... Anything new has the
   places looked at in full, and told.
3. It is over when the sensor answers at the new place and the old one is silent, or when it answers at the old one
   and its register does not say the new id. A register that does may still be obeyed, at the next power cycle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lfs10d.jobs.course import Aside
from lfs10d.jobs.job import Hold
from lfs10d.jobs.readdress import Ending, Verdict, judge, told, verified

if TYPE_CHECKING:
    from collections.abc import Generator

    from lfs10d.jobs.asking import Asking
    from lfs10d.jobs.course import Step
    from lfs10d.journal import Spot

FIRST_PAUSE = 1.0
"""Between the first look and the first probes, in s; doubled after each."""

DECIDED = frozenset({Ending.MOVED, Ending.LOCKED})
"""With these the sensor is found: at the new place, or at the old one to stay."""


def follow(
    old: Spot, new: Spot, asking: Asking, *, longest_pause: float, before: Spot | None = None
) -> Generator[Step, Any, Verdict]:
    """Ask until the sensor is found; each look that did not find it goes aside.

    `before` is where it was before it came to `old`: it may be there still.
    """
    verdict = judge((yield from verified(old, new, asking)), None, None, new.slave)
    verdict = (yield from _still_there(before, new, asking)) or verdict
    pause = min(FIRST_PAUSE, longest_pause)
    while verdict.ending not in DECIDED:
        yield Aside(verdict)
        while True:
            yield Hold(asking.clock.now + pause)
            pause = min(2 * pause, longest_pause)
            at_new = yield from asking.who(new)
            at_old = yield from asking.who(old)
            appeared = at_new.answers or at_new.noise
            still = yield from _still_there(before, new, asking)
            if appeared or still or (at_old.answers and at_old.register != new.slave):
                break
        verdict = still or judge((yield from told(old, new, asking)), None, None, new.slave)
    return verdict


def _still_there(before: Spot | None, new: Spot, asking: Asking) -> Generator[Step, Any, Verdict | None]:
    """Ask the place of before; return that the sensor stays there, None if it does not."""
    if before is None:
        return None
    reply = yield from asking.who(before)
    return Verdict(Ending.LOCKED, reply.register) if reply.answers and reply.register != new.slave else None
