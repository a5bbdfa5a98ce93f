"""The answers of one slave that may be second ones to the request before, until it shows. Pure. Times in s.

A second answer that comes when the next answer is due looks like that answer; the slave's own then follows it, and is
in turn taken for the answer to the request behind. So it does not show by itself that they are out of step.

Rules
-----
1. An answer is *unproved* while the slave's own may still come: until the time that an answer usually takes is over.
2. It is proved when that time was over before the slave was asked again, and that was answered with nothing broken
   beside it: the line was looked at, and nothing was there.
3. An answer that looks otherwise than all that are unproved, with nothing broken beside it, proves them: a slave
   answers in order, so a right answer that was still to come would have come before it.
4. While neither happens the next answers are unproved too, and none of them is proved before the last one is: each may
   be the own answer to the request before.
"""

from __future__ import annotations

from collections.abc import Hashable
from math import inf

from lfs10d.system.dataclass import dataclass

PROVED_WITHIN = 0.3
"""Seconds after which unproved answers are proved by another request."""


@dataclass(frozen=True, slots=True)
class Unproved:
    """An answer that may not be the slave's own, whole at `ended`."""

    look: Hashable
    ended: float


class UnprovedAnswers:
    """One slave's. `answers` are the oldest first; until `own_by` an own answer may still come, -inf where none may."""

    def __init__(self) -> None:
        self.answers: tuple[Unproved, ...] = ()
        self.own_by = -inf

    def answered(self, began: float, look: Hashable) -> None:
        """Note the answer to the request begun at `began`, with nothing broken beside it: rules 2 and 3."""
        if began >= self.own_by or all(each.look != look for each in self.answers):
            self.forget()

    def add(self, look: Hashable, ended: float, own_by: float) -> None:
        """Note an answer, whole at `ended`, in whose place the slave's own may still come until `own_by`."""
        self.answers = (*self.answers, Unproved(look, ended))
        self.own_by = max(self.own_by, own_by)

    def overdue(self, now: float) -> bool:
        """Return whether the oldest answer has been unproved for too long."""
        return bool(self.answers) and now - self.answers[0].ended > PROVED_WITHIN

    def forget(self) -> None:
        """Forget them: what becomes of them is decided."""
        self.answers = ()
        self.own_by = -inf
