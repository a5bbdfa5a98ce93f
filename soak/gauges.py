"""Memory, descriptors and threads of a process over its life, and whether they are flat. Pure but for `read`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

from bench.programs import weigh

WARM_UP = 45.0
"""Seconds of a life that are not judged: imports on first use, buffers that find their size."""

JUDGED_FROM = 60.0
"""Seconds of a life behind the warm-up from which on it is judged."""

POINTS_MOST = 720
"""Kept per life; beyond, every other one goes and the rest stand further apart."""

ALLOWED = {"rss": 6.0, "rss_anon": 6.0, "descriptors": 3.0, "threads": 2.0}
"""By how much the last third of a life may exceed its first, by the median, however long it is. Memory in MB: a
backlog waits in memory before it goes to the disk; descriptors and threads: a connection or a reload under way."""


@dataclass(frozen=True, slots=True)
class Point:
    """One look at a process: seconds of its life; MB, numbers."""

    at: float
    rss: float
    rss_anon: float
    descriptors: float
    threads: float


def read(pid: int, at: float) -> Point:
    """Look at a process; OSError if it is gone."""
    weight = weigh(pid)
    process = Path(f"/proc/{pid}")
    descriptors = sum(1 for _ in (process / "fd").iterdir())
    threads = sum(1 for _ in (process / "task").iterdir())
    return Point(at, weight.rss, weight.rss_anon, descriptors, threads)


@dataclass(slots=True)
class Gauge:
    """The points of one life, in order."""

    points: list[Point] = field(default_factory=list)
    highest: dict[str, float] = field(default_factory=dict)
    _apart: float = 0.0

    def add(self, point: Point) -> None:
        """Take a point; beyond what is kept, points stand further and further apart."""
        for what in ALLOWED:
            self.highest[what] = max(self.highest.get(what, 0.0), getattr(point, what))
        if self.points and point.at - self.points[-1].at < self._apart:
            return
        self.points.append(point)
        if len(self.points) > POINTS_MOST:
            self._apart = 2 * (self.points[-1].at - self.points[0].at) / POINTS_MOST
            del self.points[1::2]

    @property
    def judged(self) -> bool:
        """Whether the life is long enough to be judged."""
        return bool(self.points) and self.points[-1].at >= WARM_UP + JUDGED_FROM

    def growth(self) -> dict[str, float]:
        """Return by how much each figure grew from the first third behind the warm-up to the last, by the median."""
        warm = [point for point in self.points if point.at >= WARM_UP]
        third = max(1, len(warm) // 3)
        return {
            what: median(getattr(point, what) for point in warm[-third:])
            - median(getattr(point, what) for point in warm[:third])
            for what in ALLOWED
        }

    def grown(self) -> list[str]:
        """Return what is not flat; nothing for a life too short to be judged."""
        if not self.judged:
            return []
        return [
            f"{what} grew by {by:.1f} in {self.points[-1].at:.0f} s; {ALLOWED[what]:g} are allowed"
            for what, by in self.growth().items()
            if by > ALLOWED[what]
        ]
