"""Bytes on the wire, and collisions of two senders.

The bytes of the one that began earlier are mangled where the other speaks, and of the other only what it sends
afterwards comes through. Equal bytes at exactly the same time pass unharmed: two sensors that answer bit by bit the
same cannot be told apart.
"""

from __future__ import annotations

from typing import Final, Protocol

from lfs10d.simulator.wire import Format, misheard
from lfs10d.system.dataclass import dataclass

MASTER: Final = "master"
NOISE: Final = "noise"
SECOND_MASTER: Final = "second master"


@dataclass(slots=True, eq=False)
class Burst:
    """Bytes of one speaker: each byte and when its last bit ends."""

    speaker: object
    """The sensor; else `MASTER`, `SECOND_MASTER` or `NOISE`."""
    start: int
    data: bytearray
    ends: list[int]
    format: Format
    struck: bool = False
    """Another's bytes fell into it."""

    def cut(self, now: int) -> None:
        """End it: bytes not over by `now` never come."""
        kept = sum(end <= now for end in self.ends)
        self.struck = self.struck or kept < len(self.ends)
        del self.data[kept:], self.ends[kept:]


class Receiver(Protocol):
    """A receiver on the line: an adapter."""

    def offer(self, burst: Burst) -> None:
        """Take a burst that has just begun."""


def collide(one: Burst, other: Burst) -> None:
    """Mangle two bursts that overlap in time, in place; see the module's docstring. The later may end up empty."""
    earlier, later = (one, other) if one.start <= other.start else (other, one)
    together = earlier.start == later.start and earlier.format == later.format
    for n, end in enumerate(earlier.ends):
        if end > later.start and end - earlier.format.character < later.ends[-1]:
            against = later.data[n] if together and n < len(later.data) else later.data[0] ^ 0x5A
            if not together or (n < len(later.data) and earlier.data[n] != against):
                earlier.data[n] &= against
                earlier.struck = True
    last = earlier.ends[-1]
    lost = sum(end - later.format.character < last for end in later.ends)
    later.struck = later.struck or earlier.struck or not together
    del later.data[:lost], later.ends[:lost]


def as_heard(burst: Burst, shape: Format, first: int, last: int) -> bytes:
    """Return the bytes `first` to before `last` as a receiver of that format makes them out."""
    data = bytes(burst.data[first:last])
    return data if burst.format == shape else misheard(data)
