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
"""How long a slave is left alone after an answer to see whether another one follows, in s."""
LATEST = 1.0
"""What comes later after an answer is no second one, in s."""
MISPLACED_LATEST = 0.2
"""What comes later than this in place of another's answer is no second one, in s."""
AWAITED_MOST = 0.3
"""For a second answer that may come later the rest of the line does not wait, in s."""
TELLING = 2
"""So many extra answers tell."""
CLEAN = 30
"""So many answers in a row without another one behind them end it."""
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
    """An id is answered twice: the second answer came `delay` s after the first."""

    slave: int
    delay: float


class Duplicates:
    """What is known of each slave id of one line."""

    def __init__(self) -> None:
        self._slaves: dict[int, _SlaveExtras] = {}

    def known(self, slave: int) -> bool:
        """Whether the id is answered twice."""
        state = self._slaves.get(slave)
        return state is not None and state.extras >= TELLING

    def answered(self, slave: int, at: float, *, barrier: bool = False) -> bool:
        """Note that a request of ours was answered, whole at `at`; whether the id is no longer answered twice.

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
        """Return how long a second answer of this slave is to be awaited after its answer, in s; None: not at all."""
        state = self._slaves.get(slave)
        if state is None or not state.extras:
            return None
        if state.extras < TELLING:
            return WATCHED
        longest = 1.25 * state.delay + MARGIN
        return longest if longest <= AWAITED_MOST else None

    def watched(self, slave: int) -> float:
        """Return how long after its last answer a slave must have been silent for a second one to be over, in s."""
        state = self._slaves.get(slave)
        if state is None or state.extras < TELLING:
            return WATCHED
        return 1.25 * state.delay + MARGIN

    def extras(self, slave: int) -> int:
        """Return how many extra answers of this slave were heard."""
        state = self._slaves.get(slave)
        return 0 if state is None else state.extras

    def rest(self, slave: int, until: float) -> None:
        """Leave a slave alone until then: what it was asked may be answered still."""
        state = self._slaves.setdefault(slave, _SlaveExtras())
        state.until = max(state.until, until)

    def second(self, slave: int, at: float, *, misplaced: bool = False) -> Twice | None:
        """Note a right frame of a slave that owes nothing, whole at `at`; return what it tells, once.

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
        """Forget what is known of a slave, or of all: the port was opened, or another device is meant."""
        if slave is None:
            self._slaves.clear()
        else:
            self._slaves.pop(slave, None)
