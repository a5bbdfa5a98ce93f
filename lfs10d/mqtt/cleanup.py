"""Clears retained topics of removed devices at the broker: the shell around `OrphanSearch`.

They are read over a second connection with a client id of its own: there may be tens of thousands, and the broker's
acknowledgements of samples would wait behind them. Where the broker does not permit that, they are read over the
first. A broker that gives all connections of a user one client id (mosquitto: `use_username_as_clientid`) ends the
first connection for the second: then no second one is made again until other settings are read.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable, Iterator
from collections.abc import Set as AbstractSet

from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.messages import Accepted, Events, Filter, Incoming
from lfs10d.mqtt.orphans import OrphanSearch
from lfs10d.mqtt.reasons import Disconnect, DisconnectReason
from lfs10d.mqtt.topics import Topics
from lfs10d.telemetry.publication import Publication, retained

log = logging.getLogger(__name__)


SECOND_CLIENT = "-retained"
"""Ends the client id of the second connection."""


class Cleanup:
    """`owned()` returns the retained topics that are ours; `publish` is given what clears the others.

    `connect` begins the second connection, whose client id ends as it is told.
    """

    def __init__(
        self,
        topics: Topics,
        publish: Callable[[Iterable[Publication]], None],
        *,
        owned: Callable[[], AbstractSet[str]],
        connect: Callable[[Events, str], Connection],
    ) -> None:
        self.wanted = False
        """To begin once our own clearings have been sent; otherwise the broker would still return these topics."""
        self.single = False
        """The broker does not permit a second connection."""
        self._topics = topics
        self._owned = owned
        self._publish = publish
        self._connect = connect
        self._first: Connection | None = None
        self._second: _SecondConnection | None = None
        self._search: OrphanSearch | None = None
        self._subscription: int | None = None

    @property
    def under_way(self) -> bool:
        """Whether retained messages were requested and are arriving."""
        return self._first is not None

    @property
    def has_second(self) -> bool:
        """Whether there is a second connection."""
        return self._second is not None

    def begin(self, first: Connection | None) -> None:
        """Request the retained messages, unless that is under way or there is no connection."""
        self.wanted = False
        if first is None or self.under_way:
            return
        self._first = first
        if self.single:
            self._search_over(first)
        else:
            self._second = _SecondConnection(
                lambda events: self._connect(events, SECOND_CLIENT),
                search=self._search_over,
                on_end=self._on_second_end,
                to=self,
            )

    def _search_over(self, connection: Connection) -> None:
        loop = asyncio.get_running_loop()
        self._search = OrphanSearch(self._topics, loop.time())
        # Without retain_as_published the flag tells what was retained before, and nothing else.
        self._subscription = connection.subscribe(
            [
                Filter(topic, qos=0, retain_as_published=False, no_local=True)
                for topic in self._topics.retained_of_devices
            ]
        )
        loop.call_at(self._search.due, self._end, self._search)

    def lost(self, ended: Disconnect) -> None:
        """Abandon it: the first connection is gone."""
        if self._second is not None:
            self.single = ended.ending is DisconnectReason.TAKEN_OVER or ended.by_message
            if self.single:
                log.info("the broker may permit one connection only: no second one is made from now on")
            self._second.abandon()
        self._first = self._second = self._search = None

    def subscribed(self, mid: int) -> None:
        """Take the broker's answer to a subscription: from now on it is silent when it has sent everything."""
        if self._search is not None and mid == self._subscription:
            self._search.subscribed(asyncio.get_running_loop().time())
            asyncio.get_running_loop().call_at(self._search.due, self._end, self._search)

    def on_message(self, message: Incoming) -> bool:
        """Take a message; return whether it was one of those looked for."""
        if not message.retained or self._search is None:
            return False
        return self._search.on_message(message.topic, message.payload, asyncio.get_running_loop().time())

    def _on_second_end(self, ended: Disconnect) -> None:
        self._second = None
        if self._first is not None:
            log.info("%s, for a second connection; retained topics are read over the first", ended.message)
            self._search_over(self._first)

    def _end(self, search: OrphanSearch) -> None:
        first, second = self._first, self._second
        if first is None or search is not self._search:
            return
        loop = asyncio.get_running_loop()
        if loop.time() < search.due:
            loop.call_at(search.due, self._end, search)
            return
        self._first = self._second = self._search = None
        if second is None:
            first.unsubscribe(self._topics.retained_of_devices)
        else:
            second.leave()
        self._clear_some(search.orphans(self._owned), 0)

    def _clear_some(self, orphans: Iterator[tuple[str, ...]], cleared: int) -> None:
        some = next(orphans, None)
        if some is not None:
            self._publish(retained(topic, None) for topic in some)
            asyncio.get_running_loop().call_soon(self._clear_some, orphans, cleared + len(some))
        elif cleared:
            log.info("clearing %d retained topics of devices that are no longer configured", cleared)


class _SecondConnection:
    """The events of the second connection, until it is left or abandoned."""

    def __init__(
        self,
        connect: Callable[[Events], Connection],
        *,
        search: Callable[[Connection], None],
        on_end: Callable[[Disconnect], None],
        to: Cleanup,
    ) -> None:
        self._search = search
        self._on_end = on_end
        self._to = to
        self._over = False
        self._connection = connect(self)

    def leave(self) -> None:
        """Disconnect in order; nothing of it counts any more."""
        self._over = True
        self._connection.leave()

    def abandon(self) -> None:
        """End it at once."""
        self._over = True
        self._connection.abandon()

    def accepted(self, accepted: Accepted) -> None:
        """Subscribe."""
        del accepted
        self._search(self._connection)

    def ended(self, ended: Disconnect) -> None:
        """Report an end that we did not make."""
        if not self._over:
            self._on_end(ended)

    def acknowledged(self, mid: int, reason: int) -> None:
        """Do nothing: nothing is published here."""

    def subscribed(self, mid: int, reasons: tuple[int, ...]) -> None:
        """Pass it on."""
        del reasons
        if not self._over:
            self._to.subscribed(mid)

    def arrived(self, message: Incoming) -> None:
        """Pass it on."""
        if not self._over:
            self._to.on_message(message)
