"""Limits a job to a share of the line's time (a token bucket)."""

from __future__ import annotations

ROUNDING = 1e-9
"""What floating point may lose, in s: at `ready_at` the line is free."""


class Quota:
    """At most `rate` (0 < rate <= 1) of the line's time, with up to `credit` s taken ahead of it."""

    def __init__(self, rate: float, *, credit: float, now: float) -> None:
        self._rate = rate
        self._credit = credit
        self._level = credit
        self._at = now

    def _fill(self, now: float) -> float:
        return min(self._credit, self._level + (now - self._at) * self._rate)

    def allows(self, now: float) -> bool:
        """Whether the line may be used now; one use may overdraw the account."""
        return self._fill(now) >= -ROUNDING

    def ready_at(self, now: float) -> float:
        """When the line may be used next; not before `now`."""
        level = self._fill(now)
        return now if level >= -ROUNDING else now - level / self._rate

    def spend(self, taken: float, now: float) -> None:
        """Note that `taken` s of the line were used."""
        self._level = self._fill(now) - taken
        self._at = now
