"""Predicts when another master on the line asks a slave, so that our request waits. Pure. Times in s.

Both requests may come to the same slave at the same time, and then no answer tells whose it is. A master that asks in
a fixed rhythm leaves a pause after each answer.

Rules
-----
1. Its rhythm is the shortest time between two of its last `KEPT` requests that were heard; its exchange takes as long
   as the last one that was heard whole.
2. A request of ours that would not be over before its next one waits until that one has been answered.
3. It does not wait where the pause is too short for ours anyway, nor `FORGOTTEN` after it was heard last.
"""

from __future__ import annotations

from collections import deque
from dataclasses import field
from itertools import pairwise
from math import ceil

from lfs10d.system.dataclass import dataclass

KEPT = 6
"""Number of its requests that are remembered."""
FORGOTTEN = 3.0
"""Seconds after its last request after which it counts as gone."""
OURS = 1.4
"""Our exchange takes so many times as long as its answer did: that does not hold the request."""


@dataclass(slots=True)
class _SlaveRhythm:
    asked: deque[float] = field(default_factory=lambda: deque(maxlen=KEPT))
    took: float = 0.0


class OtherMaster:
    """The requests of other masters on one line; `slaves` are those that were asked lately, by slave id."""

    def __init__(self) -> None:
        self.slaves: dict[int, _SlaveRhythm] = {}

    def asked(self, slave: int, at: float) -> None:
        """Note a request, whole at `at`."""
        self.slaves.setdefault(slave, _SlaveRhythm()).asked.append(at)

    def answered(self, slave: int, at: float) -> None:
        """Note the answer to its last request, whole at `at`."""
        rhythm = self.slaves.get(slave)
        if rhythm is not None:
            rhythm.took = at - rhythm.asked[-1]

    def busy_until(self, slave: int, now: float) -> float | None:
        """Return until when a request of ours to the slave must wait, None if it need not."""
        rhythm = self.slaves.get(slave)
        if rhythm is None:
            return None
        last, took = rhythm.asked[-1], rhythm.took
        if now > last + FORGOTTEN:
            del self.slaves[slave]
            return None
        period = min((later - earlier for earlier, later in pairwise(rhythm.asked)), default=0.0)
        if not took or period < took * (1 + OURS):
            return None
        following = last + period * max(1, ceil((now - last) / period))
        answered = following - period + took
        if now < answered:
            return answered
        return following + took if now + took * OURS > following else None
