"""Which answers are not believed at once: what may be a second answer to the request before. Pure. Durations in s.

A second answer may come as soon as the next request is out, and looks like the answer to that.

Rules
-----
1. After an exchange in which bytes came that are no right frame the slave is left alone for `WATCHED`: what was asked
   then may be answered twice as well.
2. An answer to a request that came sooner than `WATCHED` after the slave's exchange before is *doubtful* if it took
   clearly less or more time than any of the last answers, or if other bytes came with it. It counts as not given: the
   slave is left alone for `WATCHED` (its time-out where that is longer), and asked again.
3. Where leaving it alone showed nothing, its noise is trusted for `TRUST`, doubled each time up to `TRUST_MOST`: some
   lines make noise before each answer, some lose 2 of 100. Broken answers are trusted only `APART` from each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from lfs10d.line.device import CONFIDENT_FROM, ResponseTimes
from lfs10d.line.quiet_watch import spoilt
from lfs10d.modbus.duplicates import WATCHED, Duplicates
from lfs10d.modbus.outcome import Outcome

LEAST_MARGIN = 0.002
"""By so much, or half its own length if that is more, an answer must differ from all before to be out of the usual."""
APART = 0.15
"""Broken answers nearer to each other than this, in s, are never trusted."""
TRUST = 10.0
"""How long noise raises no doubt after one in vain, in s; doubled after each."""
TRUST_MOST = 600.0
"""The longest such time in s."""


@dataclass(slots=True)
class _SlaveTrust:
    ended: float = -inf
    """When bytes came last in an exchange with it."""
    broken_at: float = -inf
    doubted_at: int | None = None
    """How many extra answers were known when noise raised a doubt that is not settled yet."""
    trust: float = TRUST
    trusted_until: float = -inf


class DoubtfulAnswers:
    """The slaves of one line."""

    def __init__(self, duplicates: Duplicates) -> None:
        self._duplicates = duplicates
        self._slaves: dict[int, _SlaveTrust] = {}

    def exchanged(self, outcome: Outcome, usual: ResponseTimes, timeout: float) -> bool:
        """Take an exchange that is over; whether its answer must not be believed. `usual` are the answers before."""
        slave, began = outcome.request.slave, outcome.began
        if began is None or not outcome.heard:
            return False
        state = self._slaves.setdefault(slave, _SlaveTrust())
        before, state.ended = state.ended, outcome.ended
        self._settle(slave, state, outcome.ended)
        if outcome.answer is None:
            if spoilt(outcome):
                self._broken(slave, state, outcome)
            return False
        if began - before >= WATCHED:
            return False
        noisy = spoilt(outcome) and outcome.ended >= state.trusted_until
        if not noisy and not _unusual(outcome, usual):
            return False
        state.doubted_at = self._duplicates.extras(slave) if noisy else None
        self._duplicates.rest(slave, outcome.ended + max(WATCHED, timeout))
        return True

    def _broken(self, slave: int, state: _SlaveTrust, outcome: Outcome) -> None:
        near = outcome.asked - state.broken_at < APART
        state.broken_at = outcome.ended
        if near or outcome.ended >= state.trusted_until:
            state.doubted_at = self._duplicates.extras(slave)
            self._duplicates.rest(slave, outcome.ended + WATCHED)

    def _settle(self, slave: int, state: _SlaveTrust, now: float) -> None:
        """Trust the slave's noise if the doubt was in vain."""
        known, state.doubted_at = state.doubted_at, None
        if known is not None and self._duplicates.extras(slave) == known:
            state.trusted_until = now + state.trust
            state.trust = min(2 * state.trust, TRUST_MOST)


def _unusual(outcome: Outcome, usual: ResponseTimes) -> bool:
    if len(usual) < CONFIDENT_FROM or outcome.turnaround is None or outcome.sent_end is None:
        return False
    length = outcome.ended - outcome.sent_end - outcome.turnaround
    margin = max(LEAST_MARGIN, length / 2)
    return not usual.least - margin <= outcome.turnaround <= usual.most + margin
