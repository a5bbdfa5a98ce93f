"""Samples that will never come: ranges of seq, to be declared by event `dropped`. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

Key: TypeAlias = tuple[str, str]
"""Device and boot."""


@dataclass(frozen=True, slots=True)
class Loss:
    """`count` samples lost within `from_seq`..`to_seq`, both included."""

    device: str
    boot: str
    from_seq: int
    to_seq: int
    count: int

    @property
    def key(self) -> Key:
        """Device and boot."""
        return self.device, self.boot

    def joined(self, other: Loss) -> Loss:
        """Return both as one."""
        return Loss(
            self.device,
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
