"""The plan of a scan: ids, rates, profiles, and how long it takes. Plain values, known before."""

from __future__ import annotations

from collections.abc import Callable

from lfs10d.line.jobs.identification import first_read
from lfs10d.modbus.frames import Codec
from lfs10d.modbus.request import ReadRegisters
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.profile import Profile
from lfs10d.system.dataclass import dataclass

FIRST_TIMEOUT = 0.1
"""Time-out of each id in s: twenty times the usual turnaround, USB adapter included."""
LAST_TIMEOUT = 1.0
"""Time-out of the last id of a round in s: the longest learned time-out of a poll."""
RESERVED_FROM = 248
"""The first id that Modbus reserves (Modbus over Serial Line V1.02, section 2.2); 255 may be a wildcard."""


def _as_it_is(_slave: int, _baudrate: int, profile: Profile) -> Profile:
    return profile


@dataclass(frozen=True, slots=True)
class ScanPlan:
    """The scan to make: `ids` at each rate of `timings`, in this order; `profiles` are tried in their order.

    `line_rate` is the rate that others speak on the line, None where nobody does. `share` is the greatest part of
    the line's time. Times in s.
    """

    ids: tuple[int, ...]
    timings: tuple[LineTiming, ...]
    codec: Codec
    profiles: tuple[Profile, ...]
    line_rate: int | None = None
    share: float = 1.0
    timeout: float = FIRST_TIMEOUT
    read_as: Callable[[int, int, Profile], Profile] = _as_it_is
    """By which profile a slave at a rate is read to find out whether it is of this one: one with its calibration."""

    @property
    def rounds(self) -> tuple[tuple[LineTiming, tuple[int, ...]], ...]:
        """Rates and ids in the order they are asked."""
        usual = tuple(slave for slave in self.ids if slave < RESERVED_FROM)
        reserved = tuple(slave for slave in self.ids if slave >= RESERVED_FROM)
        return tuple((timing, ids) for ids in (usual, reserved) if ids for timing in self.timings)

    @property
    def expected(self) -> float:
        """Duration in s if no device answers."""
        waiting = sum(
            len(ids) * (self.cost(timing) + self.timeout) + max(0.0, LAST_TIMEOUT - self.timeout)
            for timing, ids in self.rounds
        )
        return waiting / self.share

    def cost(self, timing: LineTiming) -> float:
        """Return how long one request takes on the wire, in s; the silence before it lies in the time-out before it."""
        return timing.transmission(len(self.codec.encode(self.opening(self.ids[0]))))

    def opening(self, slave: int) -> ReadRegisters:
        """Return the read that each id is asked first."""
        return first_read(self.profiles[0], slave)
