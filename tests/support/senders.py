"""A sender between an outbox and a connection, in virtual time."""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Coroutine
from dataclasses import dataclass, field

from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.messages import Accepted
from lfs10d.mqtt.reasons import Disconnect, DisconnectReason
from lfs10d.mqtt.sender import Sender
from lfs10d.mqtt.settings import Version
from lfs10d.mqtt.topics import Topics
from lfs10d.outbox.outbox import Outbox
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample, retained

ONLINE = retained("availability", "online")
LOST = Disconnect(DisconnectReason.LOST, "broker b:1: the connection is lost")


class VirtualSelector(selectors.SelectSelector):
    """Waits for nothing: the time it was asked to wait passes at once."""

    now = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Return what is ready now, else let the time pass."""
        ready = super().select(0)
        if not ready:
            assert timeout is not None, "every task waits, and no timer is pending"
            self.now += timeout
        return ready


def in_virtual_time(scenario: Coroutine[object, object, None]) -> None:
    """Run a scenario in a loop whose clock only waiting moves."""
    selector = VirtualSelector()
    loop = asyncio.SelectorEventLoop(selector)
    loop.time = lambda: selector.now  # type: ignore[method-assign]  # the loop's clock is what is replaced
    try:
        loop.run_until_complete(scenario)
    finally:
        loop.close()


@dataclass
class Wire:
    """Stands in for a connection; keeps what is handed over, and at which turn of the loop."""

    sent: list[tuple[str, bytes, int, bool, bytes | None]] = field(default_factory=list)
    gone: bool = False
    corked: bool = False
    alone: bool = False
    """A message went without cork in this turn: none may follow."""

    def cork(self, *, on: bool) -> None:
        self.corked = on

    def publish(
        self, topic: str, payload: bytes, *, qos: int = 1, retain: bool = False, correlation: bytes | None = None
    ) -> int | None:
        if self.gone:
            return None
        if not topic.endswith("/history"):  # each of those has a turn of its own
            assert not self.alone, "what goes in one turn goes by one segment"
            self.alone = not self.corked
            asyncio.get_running_loop().call_soon(self.turned)
        self.sent.append((topic, payload, qos, retain, correlation))
        return len(self.sent)

    def turned(self) -> None:
        """Begin another turn."""
        self.alone = False


class Desk:
    """A sender between an outbox and a wire, connected, its burst settled."""

    def __init__(self, *, limit: int | None = None, receive_maximum: int = 65_535) -> None:
        self.outbox = Outbox()
        self.wire = Wire()
        self.stuck = 0
        self.sender = Sender(self.outbox, Topics("b/line0"), "line0", epoch_ms=lambda: 7, stuck=self._stuck)
        self.accepted = Accepted(Version.V5, receive_maximum, limit)

    def _stuck(self) -> None:
        self.stuck += 1

    async def connect(self) -> None:
        connection: Connection = self.wire  # type: ignore[assignment]  # as much of one as is used
        self.sender.connected(connection, self.accepted)
        self.outbox.burst([], ONLINE)
        await self.turn()
        self.acknowledge()

    async def turn(self, times: int = 50) -> None:
        """Let the loop turn without time passing."""
        self.sender.wake()
        for _ in range(times):
            await asyncio.sleep(0)
        assert not self.wire.corked, "what is handed over goes"

    def acknowledge(self, reason: int = 0) -> None:
        """Answer everything that was handed over."""
        for mid in range(1, len(self.wire.sent) + 1):
            self.wire.turned()
            self.sender.acknowledged(mid, reason)

    def accept(self, topic: str) -> None:
        """Acknowledge what was handed over for one topic last."""
        mid = max(mid for mid, each in enumerate(self.topics, 1) if each == f"b/line0/{topic}")
        self.sender.acknowledged(mid, 0)

    def add(self, *publications: Publication) -> None:
        for publication in publications:
            self.outbox.add(publication, asyncio.get_running_loop().time())

    @property
    def topics(self) -> list[str]:
        return [topic for topic, *_ in self.wire.sent]


def sample(seq: int) -> Publication:
    measured = Sample("a", "k", seq, 0, "synced", None, {}, (), "bad", "timeout", None)
    return Publication("device/a/telemetry", {"seq": seq}, PublicationKind.SAMPLE, retain=False, qos=1, sample=measured)
