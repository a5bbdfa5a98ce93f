"""An uplink at a real mosquitto: samples for it, and an MQTT 5 subscriber that sees what arrives."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator, Callable

from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.mqtt.topics import InboundRequest
from lfs10d.mqtt.uplink import Uplink
from lfs10d.outbox.backlog import HISTORY_AFTER
from lfs10d.outbox.store.store import Store
from lfs10d.telemetry import publication
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample
from tests.support.brokers import Listener

B = "site/line0"
PATIENCE = 10.0


def sample(seq: int, device: str = "a") -> Publication:
    measured = Sample(
        device, "k0000001", seq, 1000 * seq, "synced", {"wind_speed": seq / 8}, {"wind_speed": "m/s"},
        ("wind_speed",), "good", None, 18.2,
    )  # fmt: skip
    topic = publication.device_topic(device, publication.TELEMETRY)
    return Publication(topic, measured.payload("line0"), PublicationKind.SAMPLE, retain=False, qos=1, sample=measured)


class Site:
    """A daemon's worth of retained topics around an uplink."""

    def __init__(
        self, port: int, *, store: Store | None = None, history_wait: float = HISTORY_AFTER, **changes: object
    ) -> None:
        facts: dict[str, object] = {"host": "127.0.0.1", "port": port, "client_id": "gateway", **changes}
        self.settings = BrokerSettings(**facts)  # type: ignore[arg-type]  # the test says which are changed
        self.retained = {f"device/{name}/state": {"device": name} for name in "abc"}
        self.requests: list[InboundRequest] = []
        self.changes: list[bool] = []
        self.announced = 0
        self.troubles: list[str | None] = []
        self.uplink = Uplink(
            self.settings,
            base=B,
            epoch_ms=lambda: 1_795_298_022_003,
            store=store,
            history_wait=history_wait,
        )

    def burst(self) -> list[Publication]:
        return [publication.retained(topic, payload) for topic, payload in self.retained.items()]

    def topics(self) -> frozenset[str]:
        return frozenset(self.retained)

    def on_request(self, request: InboundRequest) -> None:
        self.requests.append(request)

    def on_announced(self) -> None:
        self.announced += 1

    def on_spool_trouble(self, trouble: str | None) -> None:
        self.troubles.append(trouble)

    def on_uplink_change(self) -> None:
        if self.changes[-1:] != [self.uplink.connected]:
            self.changes.append(self.uplink.connected)


async def until(claim: Callable[[], bool], what: str, *, within: float = PATIENCE) -> None:
    """Let the loop turn until the claim holds."""
    deadline = time.monotonic() + within
    while not claim():
        assert time.monotonic() < deadline, f"not within {within:g} s: {what}"
        await asyncio.sleep(0.005)


@contextlib.asynccontextmanager
async def running(site: Site) -> AsyncIterator[Uplink]:
    """Start and stop an uplink."""
    await site.uplink.start(site, on_request=site.on_request, on_spool_trouble=site.on_spool_trouble)
    try:
        yield site.uplink
    finally:
        await site.uplink.stop()


async def online(listener: Listener, times: int = 1) -> None:
    """Wait until the uplink has said `online` that often."""

    def said() -> int:
        return sum(each.payload == b"online" for each in listener.on(f"{B}/availability"))

    await until(lambda: said() >= times, "online")


def seqs(listener: Listener, device: str = "a") -> set[int]:
    """Return the seqs heard of a device, live and as history."""
    live = [json.loads(each.payload) for each in listener.on(f"{B}/device/{device}/telemetry")]
    backlog = [one for each in listener.on(f"{B}/device/{device}/history") for one in json.loads(each.payload)]
    return {one["seq"] for one in live + backlog}
