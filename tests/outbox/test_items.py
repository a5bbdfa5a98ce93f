"""An item knows its topic and the samples it carries, and is equal to itself alone."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.items import HistoryBatch, LiveSample, LossNotice, Message, OutboxItem, Retained, samples_of
from lfs10d.outbox.losses import Loss
from lfs10d.telemetry.publication import Publication, PublicationKind, event, retained
from tests.support.outbox_items import live, record, recorded
from tests.support.samples import SAMPLE

KEPT = QueuedSample(SAMPLE, since=0.0)
NEXT = QueuedSample(SAMPLE, since=1.0)
LIVE = Publication("device/mast-top/telemetry", {}, PublicationKind.SAMPLE, retain=False, qos=1, sample=SAMPLE)


@pytest.mark.parametrize(
    ("item", "topic", "samples"),
    [
        (Retained(retained("line/state", {})), "line/state", ()),
        (Message(event("device_added", 0), b"c"), "event", ()),
        (LiveSample(LIVE, KEPT), "device/mast-top/telemetry", (KEPT,)),
        (HistoryBatch((KEPT, NEXT)), "device/mast-top/history", (KEPT, NEXT)),
        (HistoryBatch((QueuedSample(record(1), 0.0),)), "device/a/record", (QueuedSample(record(1), 0.0),)),
        (LossNotice(Loss("mast-top", "k3f9a2c7", 1, 2, 2)), "event", ()),
    ],
)
def test_each_item_has_its_topic_and_its_samples(
    item: OutboxItem, topic: str, samples: tuple[QueuedSample, ...]
) -> None:
    assert (item.topic, samples_of(item)) == (topic, samples)


def test_two_items_that_say_the_same_are_two_messages() -> None:
    items: list[OutboxItem] = [LiveSample(LIVE, KEPT), LiveSample(LIVE, KEPT)]
    assert items.index(items[1]) == 1


def test_a_live_sample_is_given_the_time_that_the_clock_tells_now_in_its_payload_too() -> None:
    item = live("a", 1)
    measured = replace(item.queued.sample, clock="unsynced")
    early = replace(
        item,
        queued=replace(item.queued, sample=measured, shift=0),
        publication=replace(item.publication, payload={"ts": 1000, "clock": "unsynced", "seq": 1}),
    )
    right = early.at(60_000)
    assert right.publication.payload == {
        "ts": 61_000, "time": "1970-01-01T00:01:01.000Z", "clock": "synced", "seq": 1,
    }  # fmt: skip
    assert right.publication.sample == right.queued.sample
    assert right.at(90_000) is right, "its clock was synchronised"


def test_a_live_record_is_given_the_time_that_the_clock_tells_now_in_all_its_times() -> None:
    measured = record(1, clock="unsynced")
    early = LiveSample(replace(recorded(1), sample=measured), QueuedSample(measured, 0.0, shift=0))
    payload = early.at(60_000).publication.payload
    assert payload == replace(measured, ts=660_000, clock="synced").payload("line0")
    assert isinstance(payload, dict)
    assert (payload["from"], payload["to"], payload["gust_ts"]) == (60_000, 660_000, 658_750)
