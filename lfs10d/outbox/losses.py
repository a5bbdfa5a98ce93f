"""Lost samples that are still to be reported by a `dropped` event: ranges of seq per device and boot. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field
from typing import TypeAlias

from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import Sample

MOST_RANGES = 8
"""Ranges kept apart per device and boot; beyond that the last two become one, whose `count` is below its span."""

DECLARED_EVERY = 60.0
"""Seconds between two declarations of one device and boot on one connection, so that a lasting cause is no flood."""


@dataclass(slots=True)
class Losses:
    """The losses that wait to be declared; neighbouring ranges are one."""

    total: int = 0
    """Samples lost since the start, declared or not."""
    waiting: dict[Key, list[Loss]] = field(default_factory=dict)
    """Those that wait."""
    _declared: dict[Key, float] = field(default_factory=dict)

    def add(self, sample: Sample) -> None:
        """Note that this sample will never be delivered."""
        self.evicted([Loss(sample.source, sample.boot, sample.seq, sample.seq, 1)])

    def restore(self, loss: Loss) -> None:
        """Put back a loss whose declaration was not acknowledged."""
        self.waiting[loss.key] = joined([*self.waiting.get(loss.key, ()), loss], MOST_RANGES)

    def evicted(self, losses: Iterable[Loss]) -> None:
        """Note that these are lost: the store had no room for them."""
        for loss in losses:
            self.total += loss.count
            self.restore(loss)

    def undeclared(self) -> list[Loss]:
        """Return those that wait, in order."""
        return [loss for losses in self.waiting.values() for loss in losses]

    def connected(self) -> None:
        """Let every loss be declared at once on a new connection."""
        self._declared.clear()

    def take(self, now: float) -> Loss | None:
        """Take the next to be declared at `now`, None where none is due."""
        for key, ranges in self.waiting.items():
            if now >= self._due(key):
                loss = ranges.pop(0)
                if not ranges:
                    del self.waiting[key]
                    self._declared[key] = now
                return loss
        return None

    def due(self) -> float | None:
        """Return when the next may be declared, None where none waits; -inf for at once."""
        return min(map(self._due, self.waiting), default=None)

    def _due(self, key: Key) -> float:
        declared = self._declared.get(key)
        return float("-inf") if declared is None else declared + DECLARED_EVERY


Key: TypeAlias = tuple[str, str]
"""Source and boot."""


@dataclass(frozen=True, slots=True)
class Loss:
    """`count` samples of a source lost within `from_seq`..`to_seq`, both included."""

    source: str
    boot: str
    from_seq: int
    to_seq: int
    count: int

    @property
    def key(self) -> Key:
        """Source and boot."""
        return self.source, self.boot

    def joined(self, other: Loss) -> Loss:
        """Return both as one."""
        return Loss(
            self.source,
            self.boot,
            min(self.from_seq, other.from_seq),
            max(self.to_seq, other.to_seq),
            self.count + other.count,
        )


def joined(losses: Iterable[Loss], most: int) -> list[Loss]:
    """Return the losses of one key with neighbours as one, in order.

    Beyond `most` ranges the last ones become one, whose `count` is below its span.
    """
    merged: list[Loss] = []
    for each in sorted(losses, key=lambda loss: loss.from_seq):
        if merged and each.from_seq <= merged[-1].to_seq + 1:
            merged[-1] = merged[-1].joined(each)
        else:
            merged.append(each)
    while len(merged) > most:
        merged[-2:] = [merged[-2].joined(merged[-1])]
    return merged
