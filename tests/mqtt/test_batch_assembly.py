"""A batch is serialised in slices, as far as there is room."""

from __future__ import annotations

import json

import pytest

from lfs10d.mqtt.batch_assembly import SAMPLES_AT_ONCE, BatchAssembly, room_for_batch
from lfs10d.mqtt.encoding import packet_size
from lfs10d.mqtt.messages import Accepted
from lfs10d.mqtt.settings import Version
from lfs10d.outbox.backlog import BATCH_BYTES
from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.items import HistoryBatch
from tests.support.outbox_items import batch, record

TOPIC = "b/line0/device/a/history"


@pytest.mark.parametrize("accepted", [None, Accepted(Version.V5), Accepted(Version.V5, 20, 100_000)])
def test_where_the_broker_takes_more_a_batch_has_8_kb(accepted: Accepted | None) -> None:
    assert room_for_batch(TOPIC, accepted) == BATCH_BYTES


@pytest.mark.parametrize("limit", [150, 1200, 8000])
def test_a_payload_of_the_room_fits_into_a_packet(limit: int) -> None:
    room = room_for_batch(TOPIC, Accepted(Version.V5, 20, limit))
    assert limit - 3 <= packet_size(TOPIC, bytes(room), version=Version.V5) <= limit


def test_a_slice_at_a_time() -> None:
    count = SAMPLES_AT_ONCE + 1
    assembly = BatchAssembly(batch("a", *range(1, count + 1)), 100_000)
    complete = []
    for _ in range(2):
        assert assembly.serialise_some("line0") is None
        complete.append(assembly.complete)
    assert complete == [False, True]
    assert [each["seq"] for each in json.loads(assembly.payload)] == list(range(1, count + 1))


def test_what_finds_no_room_is_cut_off() -> None:
    assembly = BatchAssembly(batch("a", 1, 2, 3), 450)
    count = assembly.serialise_some("line0")
    assert count is not None
    assembly.batch = batch("a", *range(1, count + 1))
    assert assembly.complete
    assert len(assembly.payload) <= 450


def test_one_sample_is_never_cut() -> None:
    assembly = BatchAssembly(batch("a", 1), 10)
    assert assembly.serialise_some("line0") is None
    assert assembly.complete


def test_a_record_is_an_object_by_itself_and_says_that_it_waited() -> None:
    assembly = BatchAssembly(HistoryBatch((QueuedSample(record(3), 0.0),)), 100_000)
    assert assembly.serialise_some("line0") is None
    assert json.loads(assembly.payload) == record(3).payload("line0", historical=True)
    assert json.loads(assembly.payload)["historical"] is True
