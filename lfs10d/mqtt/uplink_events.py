"""The events of the uplink."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from collections.abc import Set as AbstractSet
from typing import Protocol, TypeAlias

from lfs10d.mqtt.topics import InboundRequest
from lfs10d.telemetry.publication import Publication

OnRequest: TypeAlias = Callable[[InboundRequest], None]
"""Takes a request."""
OnSpoolTrouble: TypeAlias = Callable[[str | None], None]
"""Takes why the disk does not keep what waits; None when it does again."""


class UplinkEvents(Protocol):
    """The publications of each connect, and the events of the uplink. Called in the thread of the asyncio loop."""

    def burst(self) -> Iterable[Publication]:
        """Return every retained topic but `availability`, as it is now."""

    def topics(self) -> AbstractSet[str]:
        """Return the retained topics under `B` that are ours, but for `availability`."""

    def on_uplink_change(self) -> None:
        """Take that a connect, loss, takeover or subscription changed the properties of the uplink."""

    def on_announced(self) -> None:
        """Take that the broker has the whole burst after a connect."""
