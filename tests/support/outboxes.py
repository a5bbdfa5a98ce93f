"""An outbox in virtual time: samples and states for it, a connection, what is taken from it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

from lfs10d.outbox.items import OutboxItem, samples_of
from lfs10d.outbox.outbox import Outbox
from lfs10d.telemetry import publication as telemetry
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample

NOT_AUTHORIZED = 0x87
QUOTA_EXCEEDED = 0x97
ONLINE = telemetry.retained("availability", "online")

AnyItem = TypeVar("AnyItem", bound=OutboxItem)


def sample(seq: int, device: str = "a") -> Publication:
    """Return a live sample; its ts is 1000 x seq."""
    measured = Sample(device, "k", seq, 1000 * seq, "synced", None, {}, (), "bad", "timeout", None)
    topic = telemetry.device_topic(device, telemetry.TELEMETRY)
    return Publication(topic, {}, PublicationKind.SAMPLE, retain=False, qos=1, sample=measured)


def state(version: int, device: str = "a") -> Publication:
    return telemetry.retained(telemetry.device_topic(device, "state"), {"version": version})


def trace(number: int) -> Publication:
    return Publication("trace", {"n": number}, PublicationKind.TRACE, retain=False, qos=0)


def seqs(item: OutboxItem | None) -> list[int]:
    assert item is not None
    return [queued.sample.seq for queued in samples_of(item)]


def take(outbox: Outbox, now: float, kind: type[AnyItem]) -> AnyItem:
    item = outbox.next(now)
    assert isinstance(item, kind)
    return item


def connect(outbox: Outbox, now: float, burst: Iterable[Publication] = (), *, window: int = 20) -> None:
    """Connect, and settle the burst."""
    outbox.connected(now, window=window)
    outbox.burst(burst, ONLINE)
    while not outbox.announced:
        item = outbox.next(now)
        assert item is not None
        outbox.on_ack(item, now)


def connected(now: float = 0.0, *, capacity: int = 10_000) -> Outbox:
    outbox = Outbox(capacity=capacity)
    connect(outbox, now)
    return outbox


# What ends the connection


def under_way(outbox: Outbox) -> dict[str, int]:
    return {item.topic: 100 for item in outbox._in_flight}


def end(outbox: Outbox, now: float, sent: dict[str, int], *, denied: bool = False) -> str | None:
    """End the connection by the broker's will and connect anew; return the topic found guilty."""
    culprit = outbox.suspects.ended(sent, certain=denied)
    outbox.lost(now, culprit, denied=denied)
    return None if culprit is None else culprit.topic
