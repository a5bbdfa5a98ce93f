"""The parameters of `line/adopt`, as the change uses them."""

from __future__ import annotations

from lfs10d.profiles.library import builtin_names
from lfs10d.system.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class AdoptRequest:
    """What a command wants: the sensor at `factory` (None: as the profile says) at id `to` (None: the next free).

    `profile` is its profile's name or path, as in the configuration.
    """

    name: str | None = None
    label: str | None = None
    factory: int | None = None
    to: int | None = None
    profile: str = builtin_names()[0]

    @property
    def slaves(self) -> frozenset[int]:
        """The ids that it is known to use."""
        return frozenset(slave for slave in (self.factory, self.to) if slave is not None)
