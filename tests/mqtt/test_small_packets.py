"""Where the broker takes packets of 1200 bytes, history drains faster than it grows; in virtual time."""

from __future__ import annotations

import asyncio
import json
from dataclasses import dataclass, field
from itertools import pairwise

from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.encoding import packet_size
from lfs10d.mqtt.messages import Accepted
from lfs10d.mqtt.sender import Sender
from lfs10d.mqtt.settings import Version
from lfs10d.mqtt.topics import Topics
from lfs10d.outbox.backlog import HISTORY_AFTER
from lfs10d.outbox.outbox import IN_FLIGHT_MOST, Outbox
from lfs10d.telemetry.publication import STATE, Publication, PublicationKind, Sample, device_topic, retained
from tests.support.senders import ONLINE, in_virtual_time

PACKET = 1200
ROUND_TRIP = 0.5
DEVICES = 24
"""24 samples and 24 states a second; the window carries 20 / 0.5 s = 40 messages."""
AWAY = 120
"""Seconds measured before the broker came back."""


def sample(device: str, seq: int) -> Publication:
    measured = Sample(
        device, "k0000001", seq, 1_795_298_022_003 + 1000 * seq, "synced", {"wind_speed": seq / 8, "gust": seq / 4},
        {"wind_speed": "m/s", "gust": "m/s"}, ("wind_speed", "gust"), "good", None, 18.2,
    )  # fmt: skip
    topic = device_topic(device, "telemetry")
    return Publication(topic, measured.payload("line0"), PublicationKind.SAMPLE, retain=False, qos=1, sample=measured)


@dataclass
class SlowLink:
    """Stands in for a connection whose broker acknowledges each message one round trip later."""

    sender: Sender
    batches: list[tuple[int, int]] = field(default_factory=list)
    """Bytes on the wire and samples of each history batch."""
    largest: int = 0
    _mid: int = 0

    def cork(self, *, on: bool) -> None:
        """Nothing is gained in memory."""

    def publish(
        self, topic: str, payload: bytes, *, qos: int = 1, retain: bool = False, correlation: bytes | None = None
    ) -> int:
        assert (retain, correlation) == (topic.endswith(("state", "availability")), None)
        size = packet_size(topic, payload, version=Version.V5, qos=qos)
        self.largest = max(self.largest, size)
        if topic.endswith("history"):
            self.batches.append((size, len(json.loads(payload))))
        self._mid += 1
        asyncio.get_running_loop().call_later(ROUND_TRIP, self.sender.acknowledged, self._mid, 0)
        return self._mid


def test_with_packets_of_1200_bytes_the_backlog_shrinks_though_live_samples_find_no_room() -> None:
    async def scenario() -> None:
        loop = asyncio.get_running_loop()
        outbox = Outbox()
        sender = Sender(outbox, Topics("b/line0"), "line0", epoch_ms=lambda: 0, stuck=lambda: None)
        link = SlowLink(sender)
        connection: Connection = link  # type: ignore[assignment]  # as much of one as is used
        seq = 0

        async def measure(seconds: int) -> None:
            nonlocal seq
            for _ in range(seconds):
                seq += 1
                for number in range(DEVICES):
                    device = f"d{number}"
                    outbox.add(sample(device, seq), loop.time())
                    outbox.add(retained(device_topic(device, STATE), {"seq": seq}, refresh=True), loop.time())
                sender.wake()
                await asyncio.sleep(1.0)

        await measure(AWAY)
        sender.connected(connection, Accepted(Version.V5, 65_535, PACKET))
        outbox.burst([], ONLINE)
        await measure(int(HISTORY_AFTER) + 15)  # until the window has been given over to history
        depths = [outbox.depth]
        for _ in range(3):
            await measure(20)
            depths.append(outbox.depth)
        most = DEVICES * 4  # what is live or under way at any time
        assert all(later < max(before, most) for before, later in pairwise(depths)), depths
        for _ in range(300):
            await asyncio.sleep(1.0)
        assert outbox.depth == 0
        assert outbox.stats.dropped == 0
        assert len(outbox._in_flight) <= IN_FLIGHT_MOST
        assert link.largest <= PACKET
        full = [samples for size, samples in link.batches if size > PACKET * 0.7]
        assert full
        assert min(full) >= 3, "a batch carries what has room"

    in_virtual_time(scenario())
