"""A real broker client, and a record of what it reports."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable

from lfs10d.mqtt.broker_client import BrokerClient
from lfs10d.mqtt.messages import Accepted, Incoming
from lfs10d.mqtt.reasons import Disconnect
from lfs10d.mqtt.settings import BrokerSettings

PATIENCE = 10.0


class Witness:
    """Keeps what a client tells."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.acceptances: list[Accepted] = []
        self.endings: list[Disconnect] = []
        self.acknowledgements: dict[int, int] = {}
        self.subscriptions: dict[int, tuple[int, ...]] = {}
        self.messages: list[Incoming] = []
        self._news = asyncio.Event()

    def accepted(self, accepted: Accepted) -> None:
        self.acceptances.append(accepted)
        self._tell("accepted")

    def ended(self, ended: Disconnect) -> None:
        self.endings.append(ended)
        self._tell("ended")

    def acknowledged(self, mid: int, reason: int) -> None:
        self.acknowledgements[mid] = reason
        self._tell("acknowledged")

    def subscribed(self, mid: int, reasons: tuple[int, ...]) -> None:
        self.subscriptions[mid] = reasons
        self._tell("subscribed")

    def arrived(self, message: Incoming) -> None:
        self.messages.append(message)
        self._tell("arrived")

    def _tell(self, what: str) -> None:
        self.told.append(what)
        self._news.set()

    async def until(self, claim: Callable[[], bool]) -> None:
        """Wait for news until the claim holds."""
        async with asyncio.timeout(PATIENCE):
            while not claim():
                self._news.clear()
                await self._news.wait()


def settings_of(port: int, **changes: object) -> BrokerSettings:
    facts: dict[str, object] = {"host": "127.0.0.1", "port": port, "client_id": "tester", **changes}
    return BrokerSettings(**facts)  # type: ignore[arg-type]  # the test says which are changed


@contextlib.asynccontextmanager
async def connecting(settings: BrokerSettings) -> AsyncIterator[tuple[BrokerClient, Witness]]:
    """Give a client that has begun, and leave at the end."""
    witness = Witness()
    client = BrokerClient(settings, witness, chance=lambda: 1.0)
    client.start()
    try:
        yield client, witness
    finally:
        await client.leave(1.0)
