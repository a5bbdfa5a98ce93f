"""Slave ids that answer each request twice: a second sensor with the same id, or a repeater. Pure.

No frame says which request it answers. So a second answer that comes late is taken for the answer to the next request,
unless the slave is left alone until it has come.

Rules
-----
1. An *extra* answer is a right frame of a slave that owes nothing, within `LATEST` of its last answer.
2. After the first one, and after the first answer of a slave, it is left alone for `WATCHED`: so the time after which
   the extra one comes is measured without doubt.
3. From the second on the id counts as answered twice; the slave is asked again only after the longest such time, and a
   margin. After `CLEAN` answers with none behind them all is forgotten.
"""

from __future__ import annotations

from lfs10d.system.dataclass import dataclass

WATCHED = 0.15
"""Seconds for which a slave is left alone after an answer, to see whether another one follows."""
LATEST = 1.0
"""Longest time in s from an answer to its second one."""
MISPLACED_LATEST = 0.2
"""The same for a second answer in place of another slave's answer."""
AWAITED_MOST = 0.3
"""Longest time in s for which the rest of the line waits for a second answer."""
TELLING = 2
"""Extra answers after which the id is reported."""
CLEAN = 30
"""Single answers in a row that end it."""
MARGIN = 0.05
"""Added to a quarter more than the longest time measured, in s."""


@dataclass(slots=True)
class _SlaveExtras:
    answered_at: float = float("-inf")
    extras: int = 0
    clean: int = 0
    followed: bool = False
    """An extra answer came since the last answer."""
    delay: float = 0.0
    """The longest time from an answer to an extra one, in s."""
    until: float = float("-inf")


@dataclass(frozen=True, slots=True)
class Twice:
    """An id that is answered twice: the second answer came `delay` s after the first."""

    slave: int
    delay: float


class Duplicates:
    """The slave ids of one line that are answered twice."""

    def __init__(self) -> None:
        self._slaves: dict[int, _SlaveExtras] = {}

    def known(self, slave: int) -> bool:
        """Return whether the id is answered twice."""
        state = self._slaves.get(slave)
        return state is not None and state.extras >= TELLING

    def answered(self, slave: int, at: float, *, barrier: bool = False) -> bool:
        """Note an answer to us, complete at `at`; return whether the id is no longer answered twice.

        A second answer to a `barrier` has another length than that to a value, and needs no rest.
        """
        state = self._slaves.get(slave)
        if state is None:
            state = self._slaves[slave] = _SlaveExtras()
        if state.answered_at == float("-inf") and not barrier:
            state.until = at + WATCHED
        state.answered_at = at
        if barrier or not state.extras:
            return False
        state.clean = 0 if state.followed else state.clean + 1
        state.followed = False
        if state.clean > CLEAN:  # nothing is known yet of what follows the newest one
            ended = state.extras >= TELLING
            self._slaves[slave] = _SlaveExtras(at)
            return ended
        state.until = at + (WATCHED if state.extras < TELLING else 1.25 * state.delay + MARGIN)
        return False

    def awaited(self, slave: int) -> float | None:
        """Return how long to wait for a second answer of this slave, in s; None: not at all."""
        state = self._slaves.get(slave)
        if state is None or not state.extras:
            return None
        if state.extras < TELLING:
            return WATCHED
        longest = 1.25 * state.delay + MARGIN
        return longest if longest <= AWAITED_MOST else None

    def watched(self, slave: int) -> float:
        """Return the silence in s after the last answer of a slave that rules out a second one."""
        state = self._slaves.get(slave)
        if state is None or state.extras < TELLING:
            return WATCHED
        return 1.25 * state.delay + MARGIN

    def extras(self, slave: int) -> int:
        """Return the number of extra answers of this slave."""
        state = self._slaves.get(slave)
        return 0 if state is None else state.extras

    def rest(self, slave: int, until: float) -> None:
        """Leave a slave alone until then: an earlier request may still be answered."""
        state = self._slaves.setdefault(slave, _SlaveExtras())
        state.until = max(state.until, until)

    def second(self, slave: int, at: float, *, misplaced: bool = False) -> Twice | None:
        """Note a valid frame of a slave that owes none, complete at `at`; return the finding, once.

        `misplaced`: it came in place of another slave's answer, which may have spoken with a wrong id.
        """
        state = self._slaves.get(slave)
        if state is None or not 0 < at - state.answered_at <= (MISPLACED_LATEST if misplaced else LATEST):
            return None
        state.extras += 1
        state.followed = True
        state.delay = max(state.delay, at - state.answered_at)
        state.until = max(state.until, at + WATCHED)
        return Twice(slave, state.delay) if state.extras == TELLING else None

    def rests_until(self, slave: int, now: float) -> float | None:
        """Return until when the slave must be left alone, None if it may be asked now."""
        state = self._slaves.get(slave)
        return None if state is None or now >= state.until else state.until

    def forget(self, slave: int | None = None) -> None:
        """Forget a slave, or all: the port was opened, or the device was replaced."""
        if slave is None:
            self._slaves.clear()
        else:
            self._slaves.pop(slave, None)
