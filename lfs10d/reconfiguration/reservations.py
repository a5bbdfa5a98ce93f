"""One scan or change of sensors at a time, and the slave ids that no device may be given now. Pure."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator, Mapping

from lfs10d.command import RefusedError, Result, rejected
from lfs10d.reconfiguration.journal import OpenChange


class Reservations:
    """`underway` is the name of the command under way, None if there is none.

    `opened()` are the open changes; `update` must be called when they are others.
    """

    def __init__(self, opened: Callable[[], Iterable[OpenChange]]) -> None:
        self.underway: str | None = None
        self.brought: frozenset[int] = frozenset()
        """The slave ids that the command under way may use."""
        self.reserved: Mapping[int, str] = {}
        """The reserved slave ids, each with the reason."""
        self._opened = opened

    @property
    def busy(self) -> Result | None:
        """The rejection of whatever must wait until a scan or a change is over, None if nothing must."""
        if self.underway is None:
            return None
        return rejected("busy", f"{self.underway} is being carried out; try again when it is over")

    @contextlib.contextmanager
    def held(self, request: str, slaves: frozenset[int] = frozenset()) -> Iterator[None]:
        """Reserve the line; raises RefusedError where it is reserved. `slaves` are the ids that may come into use."""
        if (busy := self.busy) is not None:
            raise RefusedError(busy)
        self.underway, self.brought = request, slaves
        self.update()
        try:
            yield
        finally:
            self.underway, self.brought = None, frozenset()
            self.update()

    def update(self) -> None:
        """Update the open changes."""
        reserved: dict[int, str] = {}
        for change in self._opened():
            whose = ", ".join(sorted(change.devices))
            reserved |= dict.fromkeys(change.slaves, f"is reserved by the open change of {whose}")
        if self.underway is not None:
            reserved |= dict.fromkeys(self.brought, f"is about to be used by {self.underway}")
        self.reserved = reserved
