"""Doubts an answer that may be the second answer to the request before. Pure. Durations in s.

A second answer may come as soon as the next request is out, and looks like the answer to that.

Rules
-----
1. After an exchange in which bytes came that are no right frame the slave is left alone for `WATCHED`: what was asked
   then may be answered twice as well.
2. An answer to a request that came sooner than `WATCHED` after the slave's exchange before is *doubtful* if hardly any
   of the last answers took as long, or if other bytes came with it. It counts as not given: the slave is left alone for
   `WATCHED` (its time-out where that is longer), and asked again. A doubtful answer teaches no usual time.
3. Where leaving it alone showed nothing `VAIN` times in a row, its noise is trusted for `TRUST`, doubled each time up
   to `TRUST_MOST`: some lines make noise before each answer, some lose 2 of 100. Broken answers are trusted only
   `APART` from each other.
4. Any other answer to such a request is *proved* when the slave was read again, after `WATCHED` at the latest. A second
   frame of the slave before that shows that nobody knows which of the two it was. It is a matter of order, not of the
   usual times: on a busy machine bytes may lie unread for long.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from lfs10d.line.device import CONFIDENT_FROM, ResponseTimes
from lfs10d.line.quiet_watch import spoilt
from lfs10d.modbus.duplicates import WATCHED, Duplicates
from lfs10d.modbus.outcome import Outcome

LEAST_MARGIN = 0.002
"""In s: answers that differ by no more than this, or half their length if that is more, took as long."""
APART = 0.15
"""Broken answers nearer to each other than this, in s, are never trusted."""
ALIKE = 2
"""So many of the last answers must have taken as long; one of the first `CONFIDENT_FROM`."""
VAIN = 3
"""So many doubts in vain, one after the other, and noise is trusted."""
TRUST = 10.0
"""How long noise raises no doubt after one in vain, in s; doubled after each."""
TRUST_MOST = 600.0
"""The longest such time in s."""


@dataclass(slots=True)
class _SlaveTrust:
    ended: float = -inf
    """When bytes came last in an exchange with it."""
    broken_at: float = -inf
    proved_at: float = -inf
    """Until when a second frame of the slave shows that the last one may not have been its own."""
    own_by: float = -inf
    """When the slave's own would have come, by the usual times."""
    doubted_at: int | None = None
    """How many extra answers were known when noise raised a doubt that is not settled yet."""
    vain: int = 0
    """How many doubts in a row were in vain."""
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
        state = self._slaves.get(slave)
        if state is None:
            state = self._slaves[slave] = _SlaveTrust()
        before, state.ended = state.ended, outcome.ended
        state.proved_at = state.own_by = -inf
        self._settle(slave, state, outcome.ended)
        if outcome.answer is None:
            if spoilt(outcome):
                self._broken(slave, state, outcome)
            return False
        if began - before >= WATCHED:
            return False
        noisy = spoilt(outcome) and outcome.ended >= state.trusted_until
        if not noisy and not _unusual(outcome, usual):
            state.own_by = _own_by(outcome, usual)
            state.proved_at = -inf if state.own_by == -inf else outcome.ended + WATCHED
            return False
        state.doubted_at = self._duplicates.extras(slave) if noisy else None
        self._duplicates.rest(slave, outcome.ended + max(WATCHED, timeout))
        return True

    def proved_at(self, slave: int) -> float:
        """Return when the slave's last answer is proved (rule 4); -inf where it is so by its own time."""
        state = self._slaves.get(slave)
        return -inf if state is None else state.proved_at

    def own_by(self, slave: int) -> float:
        """Return when the slave's own answer would have come by the usual times; -inf where that is over."""
        state = self._slaves.get(slave)
        return -inf if state is None else state.own_by

    def doubt(self, slave: int, now: float) -> bool:
        """Doubt an answer that is not proved, for broken bytes came behind it; False where noise is trusted."""
        state = self._slaves[slave]
        if now < state.trusted_until:
            return False
        state.doubted_at = self._duplicates.extras(slave)
        self._duplicates.rest(slave, now + WATCHED)
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
        if known is None:
            return
        if self._duplicates.extras(slave) != known:
            state.vain = 0
            return
        state.vain += 1
        if state.vain >= VAIN:
            state.trusted_until = now + state.trust
            state.trust = min(2 * state.trust, TRUST_MOST)


def _unusual(outcome: Outcome, usual: ResponseTimes) -> bool:
    if not usual or outcome.turnaround is None or outcome.sent_end is None:
        return False
    length = outcome.ended - outcome.sent_end - outcome.turnaround
    margin = max(LEAST_MARGIN, length / 2)
    alike = ALIKE if len(usual) >= CONFIDENT_FROM else 1
    return usual.count_near(outcome.turnaround, margin) < alike


def _own_by(outcome: Outcome, usual: ResponseTimes) -> float:
    """Return when an answer to the same request would be over that takes as long as the slowest; -inf where it was."""
    if usual.p99 is None or outcome.turnaround is None or outcome.sent_end is None:
        return -inf
    length = outcome.ended - outcome.sent_end - outcome.turnaround
    latest = outcome.sent_end + usual.p99 + LEAST_MARGIN
    return min(latest + length, outcome.ended + WATCHED) if latest >= outcome.ended else -inf
