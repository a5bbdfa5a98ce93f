"""A verb's connection to the broker, and its requests to the daemon.

The connection has a client id of its own, no will and no queue, and leaves nothing retained.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
from collections.abc import AsyncIterator, Callable, Iterable
from typing import Any, Final

from lfs10d.cli.login import Login
from lfs10d.errors import BrokerError, FailedError
from lfs10d.mqtt.broker_client import BrokerClient
from lfs10d.mqtt.messages import Accepted, Filter, Incoming
from lfs10d.mqtt.reasons import REFUSED_FROM, Disconnect, reason_in_words
from lfs10d.mqtt.topics import OFFLINE, ONLINE

CONNECTS_WITHIN: Final = 15.0
"""s for the broker to accept the connection; one that does not know MQTT 5 and stays silent takes 5 of them."""
RETAINED_WITHIN: Final = 1.0
"""s after a subscription within which retained messages must have arrived; brokers send them at once."""
DISCONNECTS_WITHIN: Final = 0.3
PASSWORD_REFUSALS: Final = ("not authorized", "user name")
"""The reasons of a broker that wants a password, in the words of `lfs10d.mqtt.reasons`."""
NO_SUBSCRIBERS: Final = 0x10
"""PUBACK of a message without a subscriber (MQTT 5.0, section 3.4.2.1)."""


class Acknowledgements:
    """What a connection reports: reason codes by message id, and its end; wait for them with `wait_until`."""

    def __init__(self) -> None:
        self.ended_by: str | None = None
        """The reason why the connection was lost; None while it is there."""
        self.settled: dict[int, tuple[int, ...]] = {}
        """Reason codes of acknowledged subscriptions and publications, by message id."""
        self.changed = asyncio.Event()

    async def wait_until(self, condition: Callable[[], bool], within: float | None) -> bool:
        """Wait until the condition holds; return whether it does `within` s. Raises BrokerError when disconnected."""
        try:
            async with asyncio.timeout(within):
                while not condition():
                    if self.ended_by is not None:
                        raise BrokerError(self.ended_by)
                    self.changed.clear()
                    await self.changed.wait()
        except TimeoutError:
            return False
        return True

    def ended(self, ended: Disconnect) -> None:
        """Note that the connection is lost."""
        self.ended_by = ended.message
        self.changed.set()

    def acknowledged(self, mid: int, reason: int) -> None:
        """Note that a publication was acknowledged."""
        self.settled[mid] = (reason,)
        self.changed.set()

    def subscribed(self, mid: int, reasons: tuple[int, ...]) -> None:
        """Note that a subscription was acknowledged."""
        self.settled[mid] = reasons
        self.changed.set()


class CommandClient(Acknowledgements):
    """One connection. `arrived` receives the messages on `filters`; responses and availability are kept here."""

    def __init__(
        self,
        login: Login,
        filters: Iterable[Filter] = (),
        arrived: Callable[[Incoming], None] = lambda _: None,
    ) -> None:
        super().__init__()
        self.topics = login.topics
        self._missing_password = login.missing_password
        self.availability: str | None = None
        """The daemon's last availability, its will included; None before the first."""
        self._arrived = arrived
        self._own = self.topics.full(self.topics.response(f"cli-{secrets.token_hex(6)}"))
        self._filters = [
            Filter(self.topics.availability, retain_as_published=False),
            Filter(self._own),
            *filters,
        ]
        self._link = BrokerClient(login.settings, self)
        self._pending: tuple[str, frozenset[str]] | None = None
        """The id of the pending request, and the topics of its response from a daemon that knows no Response Topic."""
        self.response: dict[str, Any] | None = None
        """The response to the last request; None while there is none."""
        self.by_response_topic = False
        """The daemon answers on the Response Topic (MQTT 5.0, section 4.10), so that a request needs no id."""

    @property
    def place(self) -> str:
        """The broker as messages name it: of several nodes the one that is connected, or tried next."""
        return self._link.settings.place

    @property
    def connected(self) -> bool:
        """Whether there is a connection."""
        return self._link.connection is not None

    @property
    def request_sent(self) -> bool:
        """Whether a request was sent, acknowledged or not."""
        return self._pending is not None

    @property
    def daemon_online(self) -> bool:
        """Whether the daemon is online, by the last availability of this connection."""
        return self.connected and self.availability == ONLINE

    @property
    def daemon_gone(self) -> bool:
        """Whether the daemon, or the broker by its will, has published that it is offline."""
        return self.availability not in {None, ONLINE}

    async def connect(self, within: float = CONNECTS_WITHIN) -> None:
        """Connect and subscribe; raises BrokerError, or FailedError where the broker refuses a subscription."""
        self._link.start()
        try:
            await self._link.opened(within)
        except BrokerError as error:
            self.ended_by = str(error)  # it goes on trying, and subscribes then
            if self._missing_password and any(word in str(error) for word in PASSWORD_REFUSALS):
                raise BrokerError(f"{error}; {self._missing_password}") from None
            raise
        await self._subscribe(self._filters)

    async def disconnect(self) -> None:
        """Disconnect."""
        await self._link.leave(DISCONNECTS_WITHIN)

    async def require_daemon(self) -> None:
        """Raise BrokerError unless the daemon is online."""
        await self.wait_until(lambda: self.availability is not None, RETAINED_WITHIN)
        base = self.topics.base
        if self.availability is None:
            raise BrokerError(
                f"{self.place}: no daemon has ever published at {base}: is it running, "
                "and with this line.name and mqtt.base_topic?"
            )
        if self.availability != ONLINE:
            raise BrokerError(f"{self.place}: the daemon of {base} is {OFFLINE}: start it, or see its log")

    async def wait_for_daemon(self) -> None:
        """Wait until the broker is connected and the daemon online again."""
        while not self.daemon_online:
            self.changed.clear()
            await self.changed.wait()

    async def request(self, name: str, content: dict[str, Any], within: float | None) -> dict[str, Any] | None:
        """Send a request and return its response, None if none came `within` s.

        `content` has a text as `id` or as `transaction`, unless `by_response_topic`. Raises BrokerError where broker
        or daemon goes away before it has answered.
        """
        token = str(content.get("id") or content.get("transaction") or secrets.token_hex(6))
        usual = [self.topics.full(self.topics.response(each)) for each in (name, "unknown")]
        self._pending, self.response = (token, frozenset(usual)), None
        await self._subscribe([Filter(topic) for topic in usual])
        connection = self._link.connection
        mid = None
        if connection is not None:
            topic, payload = self.topics.full(f"request/{name}"), json.dumps(content).encode()
            mid = connection.publish(topic, payload, response_topic=self._own, correlation=token.encode())
        if mid is None:
            raise BrokerError(f"{self.place}: the connection is lost; nothing was sent")
        try:
            await self.wait_until(lambda: mid in self.settled or self._answered, within)
            self._check_acknowledgement(self.settled.get(mid, (0,))[0], name)
            await self.wait_until(lambda: self._answered or self.daemon_gone, within)
        except BrokerError as error:
            raise BrokerError(f"{error}; {name} may or may not have been carried out") from None
        if not self._answered and self.daemon_gone:
            raise BrokerError(f"{self.place}: the daemon went offline before it answered {name}")
        return self.response

    def send(self, name: str, content: dict[str, Any]) -> None:
        """Send a request without waiting for its response; the request before may still be answered."""
        connection = self._link.connection
        if connection is not None:
            connection.publish(self.topics.full(f"request/{name}"), json.dumps(content).encode())

    @property
    def _answered(self) -> bool:
        return self.response is not None

    def _check_acknowledgement(self, reason: int, name: str) -> None:
        if reason == NO_SUBSCRIBERS:
            raise BrokerError(f"{self.place}: no subscriber for requests on {self.topics.base}: check the broker's ACL")
        if reason >= REFUSED_FROM:
            raise FailedError(f"{self.place} refuses the request {name}: {reason_in_words(reason)}")

    async def _subscribe(self, filters: list[Filter]) -> None:
        connection = self._link.connection
        mid = None if connection is None else connection.subscribe(filters)
        if mid is None:
            raise BrokerError(self.ended_by or f"{self.place}: the connection is lost")
        await self.wait_until(lambda: mid in self.settled, CONNECTS_WITHIN)
        for each, reason in zip(filters, self.settled.get(mid, ()), strict=False):
            if reason >= REFUSED_FROM:
                raise FailedError(f"{self.place} refuses the subscription to {each.topic}: {reason_in_words(reason)}")

    # Events of the link

    def accepted(self, accepted: Accepted) -> None:
        """Note the connection, and subscribe again after a loss."""
        del accepted
        again, self.ended_by = self.ended_by is not None, None
        if again and self._link.connection is not None:
            self._link.connection.subscribe(self._filters)
        self.changed.set()

    def ended(self, ended: Disconnect) -> None:
        """Note that the connection is lost, and with it what was known of the daemon."""
        self.availability = None
        super().ended(ended)

    def arrived(self, message: Incoming) -> None:
        """Keep a response or the daemon's availability; pass other messages on."""
        if message.topic == self.topics.availability:
            self.availability = message.payload.decode("utf-8", "replace")
        elif self._pending is not None and message.topic in {self._own, *self._pending[1]}:
            self._take(message, self._pending[0])
        else:
            self._arrived(message)
        self.changed.set()

    def _take(self, message: Incoming, token: str) -> None:
        response = parsed(message.payload)
        if not isinstance(response, dict) or message.retained:
            return
        ours = message.topic == self._own and message.correlation in {None, token.encode()}
        if ours or token in (response.get("id"), response.get("transaction")):
            self.response = response
            self.by_response_topic = ours


@contextlib.asynccontextmanager
async def at_daemon(client: CommandClient) -> AsyncIterator[None]:
    """Connect to a daemon that is online, until the block ends; raises BrokerError, FailedError."""
    try:
        await client.connect()
        await client.require_daemon()
        yield
    finally:
        await client.disconnect()


def parsed(payload: bytes) -> Any:  # noqa: ANN401  # any JSON
    """Return a payload's JSON, None if it is not JSON: any client may have published it."""
    try:
        return json.loads(payload)
    except (ValueError, RecursionError):
        return None


def content(payload: bytes) -> Any:  # noqa: ANN401  # any JSON
    """Return a payload's JSON, or its bare word."""
    found = parsed(payload)
    return payload.decode("utf-8", "replace") if found is None else found
