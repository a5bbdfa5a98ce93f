"""The line time that a change of a sensor is charged, so that polls keep 90 % of their rate on a 70 % full line. Pure.

Rules
-----
1. A change (a re-address, an adoption) waits in silence to learn that nobody is there. While it does, devices with a
   shorter interval miss polls. For the time beyond the shortest interval it is charged so much that what is missed
   stays below `MISSED` of all.
2. On a line that the polls fill by more than `BUSY`, what waited must go before more is put off: there a change is
   charged `CROWDED` times the time it takes.
"""

from __future__ import annotations

from collections.abc import Collection
from math import inf

MISSED = 0.08
"""Greatest part of the other polls that a change may make them miss; a little less than a tenth."""
BUSY = 0.5
"""Part of the line that polls may fill before it counts as crowded."""
CROWDED = 1.5
TURNAROUND = 0.005
"""Response time in s of a usual sensor, to estimate the load of the line."""


class Surcharge:
    """Adds up how long a change has had the line. One for each line."""

    def __init__(self) -> None:
        self._since: float | None = None

    def charge(
        self, share: float, began: float, ended: float, *, intervals: Collection[float], wire_time: float
    ) -> float:
        """Return the line time (s) that a change of this `share` is charged for an exchange from `began` to `ended`.

        `intervals` (s) are those of the devices that are polled beside it (0: as fast as the line allows), one of
        which takes `wire_time` s.
        """
        self._since = since = began if self._since is None else self._since
        grids = [interval for interval in intervals if interval > 0]
        shortest = min(grids, default=inf)
        missed = max(0.0, ended - since - shortest) - max(0.0, began - since - shortest)
        busy = len(grids) < len(intervals) or sum((wire_time + TURNAROUND) / each for each in grids) > BUSY
        return max((ended - began) * (CROWDED if busy else 1.0), missed * share / MISSED)

    def released(self) -> None:
        """Note that others may use the line again."""
        self._since = None
