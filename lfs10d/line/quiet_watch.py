"""Keeps the line quiet after an answer where a second one may follow, to hear it. Pure. Durations in s.

A second answer that collides with the request or the reply of a neighbour is never received whole, and costs the
neighbour its value each time. So the line itself must be silent for a moment.

Rules
-----
1. An exchange is *spoilt* if bytes came that belong to nothing, or if a device that is online was silent. It speaks
   against every slave that answered up to `REACH` before, the one asked included.
2. Where `SAME` answers of a slave are followed by a spoilt exchange of the same one, or `ANY` by one of any (those
   that are not take back `MISS` each), the line is kept quiet for `WATCHED` after its next answer; after a watch in
   vain not before `AGAIN`, doubled each time up to `AGAIN_MOST`. All watches take at most `SHARE` of the line.
3. After an answer of a slave that has said one too many the line is kept quiet too, after one of a slave that is known
   to be answered twice until the second answer has come; not after `VAIN` times in vain in a row.
"""

from __future__ import annotations

from dataclasses import field
from math import inf

from lfs10d.line.quota import Quota
from lfs10d.modbus.duplicates import WATCHED, Duplicates
from lfs10d.modbus.outcome import Outcome
from lfs10d.reading import FaultCode
from lfs10d.system.dataclass import dataclass

REACH = 0.2
"""Seconds after an answer in which a second one may spoil an exchange."""
SAME = 3
"""Answers followed by a spoilt exchange of the same slave that raise a suspicion."""
ANY = 5
"""Answers followed by a spoilt exchange of any slave that do."""
MISS = 0.5
"""Part of such an answer that one without a spoilt exchange takes back."""
AGAIN = 5.0
"""The first pause in s after a watch in vain; doubled after each."""
AGAIN_MOST = 600.0
"""The longest pause in s between two watches of one slave."""
VAIN = 2
"""Number of watches in a row without a second answer after which the line does not wait for one."""
SHARE = 0.005
"""The part of the line that watches for a suspicion may take."""
CREDIT = 0.45
"""Line time in s that they may take ahead of it."""
_SPOILT = frozenset({FaultCode.CRC, FaultCode.MALFORMED, FaultCode.COLLISION})
"""What two that speak at once look like; a whole frame of another slave is told by itself."""


def spoilt(outcome: Outcome) -> bool:
    """Return whether bytes came in an exchange that are no valid frame."""
    if outcome.fault is None:
        return outcome.unsolicited > 0
    return outcome.fault.code in _SPOILT


@dataclass(slots=True)
class _SlaveQuiet:
    answered_at: float = -inf
    hit: set[int] = field(default_factory=set)
    """Neighbours whose exchanges were spoilt since the last answer."""
    same: dict[int, float] = field(default_factory=dict)
    any: float = 0.0
    awaited_until: float = -inf
    vain: int = 0
    """Watches in a row, the last one included, in which no second answer came."""
    again_at: float = -inf
    again: float = AGAIN


def _counted(count: float, *, hit: bool) -> float:
    return count + 1.0 if hit else max(0.0, count - MISS)


class QuietWatch:
    """One line; `now` is its clock at the beginning. No slave is asked before `until`."""

    def __init__(self, duplicates: Duplicates, now: float) -> None:
        self.until = -inf
        self._duplicates = duplicates
        self._slaves: dict[int, _SlaveQuiet] = {}
        self._share = Quota(SHARE, credit=CREDIT, now=now)

    def exchanged(self, outcome: Outcome, *, online: bool) -> None:
        """Take an exchange with a configured device that is over; `online`: an answer was to be expected."""
        silent = online and outcome.fault is not None and outcome.fault.code is FaultCode.TIMEOUT
        if not (silent or spoilt(outcome)):
            return
        asked = outcome.request.slave
        for state in self._slaves.values():
            if outcome.ended - state.answered_at <= REACH:
                state.hit.add(asked)

    def answered(self, slave: int, at: float) -> None:
        """Take a right answer of a slave, whole at `at`: the line may have to be quiet now."""
        state = self._slaves.get(slave)
        if state is None:
            state = self._slaves[slave] = _SlaveQuiet()
        awaited = self._duplicates.awaited(slave)
        if awaited is None and not (state.hit or state.same or state.any):  # as nearly always
            state.answered_at = at
            return
        suspected, own = self._suspected(state), slave in state.hit
        for each in state.hit | state.same.keys():
            state.same[each] = _counted(state.same.get(each, 0.0), hit=each in state.hit)
        state.any = _counted(state.any, hit=bool(state.hit))
        state.hit.clear()
        state.answered_at = at
        if awaited is not None:
            state.awaited_until = at + awaited
            if state.vain < VAIN:
                state.vain += 1
                self.until = state.awaited_until
        elif own:  # it speaks too late to tell: what was asked before is over by it
            return
        elif (suspected or self._suspected(state)) and at >= state.again_at and self._share.allows(at):
            self.until = at + WATCHED
            self._share.spend(WATCHED, at)
            state.again_at = at + state.again
            state.again = min(2 * state.again, AGAIN_MOST)

    def _suspected(self, state: _SlaveQuiet) -> bool:
        return state.any >= ANY or any(count >= SAME for count in state.same.values())

    def second(self, slave: int, at: float) -> None:
        """Note an answer too many of a slave, whole at `at`: what the line was kept quiet for has come."""
        state = self._slaves.get(slave)
        if state is not None:
            state.again = AGAIN
            if at <= state.awaited_until:
                state.vain = 0
            self.until = min(self.until, at)
