"""A clean exit stays within the Receive Maximum of the broker, whatever waits."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import pytest

from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.mqtt.topics import InboundRequest
from lfs10d.mqtt.uplink import Uplink
from lfs10d.telemetry import publication
from lfs10d.telemetry.publication import Publication
from tests.support.answering_brokers import BASE, Capricious
from tests.support.brokers import eventually

EVENTS = 3


@pytest.fixture
def strict() -> Iterator[Capricious]:
    """Give a broker that throws out a client with two messages under way, and acknowledges 50 ms late."""
    broker = Capricious(receive_maximum=1, delay=0.05)
    yield broker
    broker.close()


class Site:
    """One retained topic; `announced` is set when the broker has the burst."""

    def __init__(self) -> None:
        self.announced = asyncio.Event()

    def burst(self) -> list[Publication]:
        return [publication.retained("line/state", {"n": 1})]

    def topics(self) -> frozenset[str]:
        return frozenset({"line/state"})

    def on_request(self, request: InboundRequest) -> None:
        """None comes."""

    def on_uplink_change(self) -> None:
        """Of no interest."""

    def on_announced(self) -> None:
        self.announced.set()

    def on_spool_trouble(self, trouble: str | None) -> None:
        """There is no store."""


async def announced(broker: Capricious) -> Uplink:
    """Return an uplink whose burst the broker has."""
    site = Site()
    settings = BrokerSettings(host="127.0.0.1", port=broker.port, client_id="gateway")
    uplink = Uplink(settings, base=BASE.rstrip("/"), epoch_ms=lambda: 0)
    await uplink.start(site, on_request=site.on_request, on_spool_trouble=site.on_spool_trouble)
    await asyncio.wait_for(site.announced.wait(), 10.0)
    return uplink


def test_offline_waits_for_its_turn_where_one_message_may_be_under_way(strict: Capricious) -> None:
    async def scenario() -> None:
        uplink = await announced(strict)
        uplink.publish([publication.event("scan_progress", number) for number in range(EVENTS)])
        await uplink.stop()

    asyncio.run(scenario())
    eventually(lambda: strict.gone == 1, "the connection is over")
    assert strict.exceeded == 0
    assert strict.taken("availability") == [b"online", b"offline"]
    assert len(strict.taken("event")) == EVENTS
    assert (strict.connects, strict.disconnects) == (1, 1)


def test_what_cannot_go_in_time_makes_no_room_for_anything_else(strict: Capricious) -> None:
    """More waits than the time of a clean exit has room for: `offline` goes next, and nothing after it."""

    async def scenario() -> None:
        uplink = await announced(strict)
        strict.delay = 0.3
        uplink.publish([publication.event("scan_progress", number) for number in range(20)])
        await uplink.stop()

    asyncio.run(scenario())
    eventually(lambda: strict.gone == 1, "the connection is over")
    assert strict.exceeded == 0
    assert strict.taken("availability")[-1] == b"offline"
    assert 1 <= len(strict.taken("event")) <= EVENTS
    assert strict.disconnects == 1


def test_where_the_window_never_opens_the_broker_publishes_the_will(strict: Capricious) -> None:
    async def scenario() -> None:
        uplink = await announced(strict)
        strict.delay = None
        uplink.publish([publication.event("scan_progress", 0)])
        await uplink.stop()

    asyncio.run(scenario())
    eventually(lambda: strict.gone == 1, "the connection is over")
    assert strict.exceeded == 0
    assert strict.taken("availability") == [b"online"]
    assert strict.disconnects == 0, "a DISCONNECT would make the broker drop the will"
