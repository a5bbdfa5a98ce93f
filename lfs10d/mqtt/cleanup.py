"""Retained topics of devices that are gone: looked for at the broker, and cleared. A shell around `OrphanSearch`."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable
from collections.abc import Set as AbstractSet

from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.messages import Filter, Incoming
from lfs10d.mqtt.orphans import OrphanSearch
from lfs10d.mqtt.topics import Topics

log = logging.getLogger(__name__)


class Cleanup:
    """`owned()` returns the retained topics that are ours; `clear` is given the others."""

    def __init__(
        self,
        topics: Topics,
        *,
        owned: Callable[[], AbstractSet[str]],
        clear: Callable[[Iterable[str]], None],
    ) -> None:
        self.wanted = False
        """To be begun as soon as what we clear ourselves has gone out: else the broker would show it as left over."""
        self._topics = topics
        self._owned = owned
        self._clear = clear
        self._standing: Connection | None = None
        self._search: OrphanSearch | None = None

    @property
    def under_way(self) -> bool:
        """The broker is sending what it retains."""
        return self._search is not None

    def begin(self, standing: Connection | None) -> None:
        """Have the broker send what it retains, unless that is under way or it is away."""
        self.wanted = False
        if standing is None or self._search is not None:
            return
        loop = asyncio.get_running_loop()
        self._standing, self._search = standing, OrphanSearch(self._topics, loop.time())
        standing.subscribe(
            [
                Filter(topic, qos=0, retain_as_published=False, no_local=True)
                for topic in self._topics.retained_of_devices
            ]
        )
        loop.call_at(self._search.due, self._end, self._search)

    def lost(self) -> None:
        """Abandon it: the connection is gone."""
        self._standing = self._search = None

    def on_message(self, message: Incoming) -> bool:
        """Take a message; return whether it was one of those looked for."""
        if not message.retained or self._search is None:
            return False
        return self._search.on_message(message.topic, message.payload, asyncio.get_running_loop().time())

    def _end(self, search: OrphanSearch) -> None:
        standing = self._standing
        if standing is None or search is not self._search:
            return
        loop = asyncio.get_running_loop()
        if loop.time() < search.due:
            loop.call_at(search.due, self._end, search)
            return
        self._standing = self._search = None
        standing.unsubscribe(self._topics.retained_of_devices)
        orphans = search.orphans(self._owned())
        if orphans:
            log.info("clearing %d retained topics of devices that are no longer configured", len(orphans))
            self._clear(orphans)
