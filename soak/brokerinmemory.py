"""A broker that is an object in memory, and the connection to it that takes the place of paho's."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.messages import Accepted, Events, Filter, Will
from lfs10d.mqtt.reasons import Disconnect, DisconnectReason
from lfs10d.mqtt.settings import BrokerSettings, Version


class BrokerInMemory:
    """Takes everything, keeps what is published under devices; can be away. `published` is in order of arrival."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.loop = loop
        self.up = True
        self.published: list[tuple[str, bytes]] = []
        self.connections: dict[str, ConnectionInMemory] = {}
        """By client id."""

    def go(self) -> None:
        """Be away from now on; what was not acknowledged was taken all the same."""
        self.up = False
        for connection in self.connections.values():
            connection.tell("ended", Disconnect(DisconnectReason.LOST, "the broker is away"))
        self.connections.clear()

    def come(self) -> None:
        """Be back."""
        self.up = True

    def connect(self) -> type[Connection]:
        """Return what connects to this broker."""
        broker = self

        class Here(ConnectionInMemory):
            home = broker

        return Here


class ConnectionInMemory(Connection):
    """A connection to `home`, which acknowledges when the loop comes round."""

    home: BrokerInMemory

    def __init__(self, settings: BrokerSettings, version: Version, events: Events, *, will: Will | None = None) -> None:
        del will
        self._client_id = settings.client_id
        self._told: Events | None = events
        self._last = 0
        if self.home.up:
            self.home.connections[settings.client_id] = self
            self.tell("accepted", Accepted(version))
        else:
            self.tell("ended", Disconnect(DisconnectReason.UNREACHABLE, "the broker is away"))

    def tell(self, what: str, *values: object) -> None:
        """Tell the uplink soon, unless it has abandoned this connection until then."""
        self.home.loop.call_soon(self._tell, what, values)

    def _tell(self, what: str, values: Sequence[object]) -> None:
        if self._told is not None:
            told, self._told = self._told, None if what == "ended" else self._told
            getattr(told, what)(*values)

    def publish(
        self,
        topic: str,
        payload: bytes,
        *,
        qos: int = 1,
        retain: bool = False,
        response_topic: str | None = None,
        correlation: bytes | None = None,
    ) -> int | None:
        """Take one message."""
        del qos, retain, response_topic, correlation
        if self.home.connections.get(self._client_id) is not self:
            return None
        self.home.published.append((topic, payload))
        self._last += 1
        self.tell("acknowledged", self._last, 0)
        return self._last

    def cork(self, *, on: bool) -> None:
        """Do nothing: nothing waits."""
        del on

    def subscribe(self, filters: Sequence[Filter]) -> int | None:
        """Grant everything; nobody else publishes here."""
        self._last += 1
        self.tell("subscribed", self._last, (1,) * len(filters))
        return self._last

    def unsubscribe(self, topics: Sequence[str]) -> None:
        """Do nothing."""

    def leave(self) -> None:
        """End in order."""
        self.tell("ended", Disconnect(DisconnectReason.LEFT, "left"))

    def abandon(self) -> None:
        """End without a word."""
        self._told = None
