"""A verb's connection to the broker, and the requests it sends to the daemon behind it.

A visitor has a client id of its own, no will and no queue, and keeps nothing on the broker.
"""

from __future__ import annotations

import asyncio
import json
import secrets
from collections.abc import Callable, Iterable
from typing import Any, Final

from lfs10d.cli.login import Login
from lfs10d.errors import BrokerError, FailedError
from lfs10d.mqtt.broker_client import BrokerClient
from lfs10d.mqtt.messages import Accepted, Filter, Incoming
from lfs10d.mqtt.reasons import REFUSED_FROM, Disconnect, reason_in_words
from lfs10d.mqtt.topics import OFFLINE, ONLINE

CONNECTS_WITHIN: Final = 15.0
"""s for the broker to accept us: one that does not know MQTT 5 and says nothing costs 5 of them."""
RETAINED_WITHIN: Final = 1.0
"""s after a subscription in which what is retained must have come; brokers send it at once."""
LEAVES_WITHIN: Final = 0.3
REFUSALS: Final = ("not authorized", "user name")
"""What a broker that wants a password says, in the words of `lfs10d.mqtt.reasons`."""
NOBODY_LISTENS: Final = 0x10
"""PUBACK of a message without a subscriber (MQTT 5.0, section 3.4.2.1)."""


class CommandClient:
    """One visit. `arrived` is given what comes on `filters`; responses and our daemon's availability are kept here."""

    def __init__(
        self,
        login: Login,
        filters: Iterable[Filter] = (),
        arrived: Callable[[Incoming], None] = lambda _: None,
    ) -> None:
        self.topics = login.topics
        self.place = login.settings.place
        self._lacking = login.lacking
        self.availability: str | None = None
        """What our daemon said last, or its will; None: nothing."""
        self.ended_by: str | None = None
        """Why the connection was lost, in words; None while it stands."""
        self._arrived = arrived
        self._own = self.topics.full(self.topics.response(f"cli-{secrets.token_hex(6)}"))
        self._filters = [
            Filter(self.topics.availability, retain_as_published=False),
            Filter(self._own),
            *filters,
        ]
        self._link = BrokerClient(login.settings, self)
        self._changed = asyncio.Event()
        self._settled: dict[int, tuple[int, ...]] = {}
        """What the broker said to a subscription or a publication, by message id."""
        self._asked: tuple[str, frozenset[str]] | None = None
        """The id that is asked for, and the topics on which a daemon answers that knows no Response Topic."""
        self._response: dict[str, Any] | None = None
        self.by_response_topic = False
        """The daemon answers where it is asked to (MQTT 5.0, section 4.10), so that a request needs no id."""

    @property
    def connected(self) -> bool:
        """The broker is there."""
        return self._link.standing is not None

    @property
    def asked(self) -> bool:
        """A request was on its way, whatever became of it."""
        return self._asked is not None

    @property
    def daemon_online(self) -> bool:
        """Our daemon says so, and we would hear if it did not."""
        return self.connected and self.availability == ONLINE

    @property
    def daemon_gone(self) -> bool:
        """Our daemon, or the broker for it, says that it is not there."""
        return self.availability not in {None, ONLINE}

    async def enter(self, within: float = CONNECTS_WITHIN) -> None:
        """Connect and subscribe; raises BrokerError, FailedError where the broker does not let us hear."""
        self._link.start()
        try:
            await self._link.opened(within)
        except BrokerError as error:
            if self._lacking and any(word in str(error) for word in REFUSALS):
                raise BrokerError(f"{error}; {self._lacking}") from None
            raise
        await self._subscribe(self._filters)

    async def leave(self) -> None:
        """Disconnect."""
        await self._link.leave(LEAVES_WITHIN)

    async def find_daemon(self) -> None:
        """Raise BrokerError unless our daemon is there."""
        await self.until(lambda: self.availability is not None, RETAINED_WITHIN)
        base = self.topics.base
        if self.availability is None:
            raise BrokerError(
                f"{self.place}: no daemon has ever been seen at {base}: does it run, "
                "and with this line.name and mqtt.base_topic?"
            )
        if self.availability != ONLINE:
            raise BrokerError(f"{self.place}: the daemon of {base} is {OFFLINE}: start it, or look into its log")

    async def come_back(self) -> None:
        """Wait until the broker and our daemon are there again."""
        while not self.daemon_online:
            self._changed.clear()
            await self._changed.wait()

    async def ask(self, name: str, content: dict[str, Any], within: float | None) -> dict[str, Any] | None:
        """Send a request and return its response, None if none came `within` s.

        `content` has a text as `id` or as `transaction`, unless `by_response_topic`. Raises BrokerError where broker
        or daemon goes away before it has answered.
        """
        token = str(content.get("id") or content.get("transaction") or secrets.token_hex(6))
        usual = [self.topics.full(self.topics.response(each)) for each in (name, "unknown")]
        self._asked, self._response = (token, frozenset(usual)), None
        await self._subscribe([Filter(topic) for topic in usual])
        connection = self._link.standing
        mid = None
        if connection is not None:
            topic, payload = self.topics.full(f"request/{name}"), json.dumps(content).encode()
            mid = connection.publish(topic, payload, response_topic=self._own, correlation=token.encode())
        if mid is None:
            raise BrokerError(f"{self.place}: the connection is lost; nothing was sent")
        try:
            await self.until(lambda: mid in self._settled or self._answered, within)
            self._judge(self._settled.get(mid, (0,))[0], name)
            await self.until(lambda: self._answered or self.daemon_gone, within)
        except BrokerError as error:
            raise BrokerError(f"{error}; whether {name} was obeyed is not known") from None
        if not self._answered and self.daemon_gone:
            raise BrokerError(f"{self.place}: the daemon went away before it answered {name}")
        return self._response

    def send(self, name: str, content: dict[str, Any]) -> None:
        """Send a request whose response nobody waits for: what was asked for before may still be answered."""
        connection = self._link.standing
        if connection is not None:
            connection.publish(self.topics.full(f"request/{name}"), json.dumps(content).encode())

    @property
    def response(self) -> dict[str, Any] | None:
        """What was answered to what was asked last; None while nothing was."""
        return self._response

    @property
    def _answered(self) -> bool:
        return self._response is not None

    def _judge(self, reason: int, name: str) -> None:
        if reason == NOBODY_LISTENS:
            raise BrokerError(f"{self.place}: nobody takes requests for {self.topics.base}: is the daemon allowed to?")
        if reason >= REFUSED_FROM:
            raise FailedError(f"{self.place}: does not let us send {name}: {reason_in_words(reason)}")

    async def _subscribe(self, filters: list[Filter]) -> None:
        connection = self._link.standing
        mid = None if connection is None else connection.subscribe(filters)
        if mid is None:
            raise BrokerError(self.ended_by or f"{self.place}: the connection is lost")
        await self.until(lambda: mid in self._settled, CONNECTS_WITHIN)
        for each, reason in zip(filters, self._settled.get(mid, ()), strict=False):
            if reason >= REFUSED_FROM:
                raise FailedError(f"{self.place}: does not let us hear {each.topic}: {reason_in_words(reason)}")

    async def until(self, claim: Callable[[], bool], within: float | None) -> bool:
        """Wait until the claim holds; return whether it does `within` s. BrokerError when the connection goes."""
        try:
            async with asyncio.timeout(within):
                while not claim():
                    if self.ended_by is not None:
                        raise BrokerError(self.ended_by)
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError:
            return False
        return True

    # Events of the link

    def accepted(self, accepted: Accepted) -> None:
        """Note that the connection stands, and subscribe again after a loss."""
        del accepted
        again, self.ended_by = self.ended_by is not None, None
        if again and self._link.standing is not None:
            self._link.standing.subscribe(self._filters)
        self._changed.set()

    def ended(self, ended: Disconnect) -> None:
        """Note that the connection is lost."""
        self.ended_by = ended.message
        self.availability = None
        self._changed.set()

    def acknowledged(self, mid: int, reason: int) -> None:
        """Note what became of a request."""
        self._settled[mid] = (reason,)
        self._changed.set()

    def subscribed(self, mid: int, reasons: tuple[int, ...]) -> None:
        """Note what became of a subscription."""
        self._settled[mid] = reasons
        self._changed.set()

    def arrived(self, message: Incoming) -> None:
        """Keep a response or our daemon's availability; pass on the rest."""
        if message.topic == self.topics.availability:
            self.availability = message.payload.decode("utf-8", "replace")
        elif self._asked is not None and message.topic in {self._own, *self._asked[1]}:
            self._take(message, self._asked[0])
        else:
            self._arrived(message)
        self._changed.set()

    def _take(self, message: Incoming, token: str) -> None:
        response = parsed(message.payload)
        if not isinstance(response, dict) or message.retained:
            return
        ours = message.topic == self._own and message.correlation in {None, token.encode()}
        if ours or token in (response.get("id"), response.get("transaction")):
            self._response = response
            self.by_response_topic = ours


def parsed(payload: bytes) -> Any:  # noqa: ANN401  # any JSON
    """Return what a payload says, None if it is no JSON; it may come from anybody."""
    try:
        return json.loads(payload)
    except (ValueError, RecursionError):
        return None
