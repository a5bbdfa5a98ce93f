"""Records in the backlog: kept, sent one by one, refused apart from samples."""

from __future__ import annotations

from lfs10d.outbox.backlog import HISTORY_AFTER, Backlog
from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.items import HistoryBatch, LossNotice
from lfs10d.outbox.losses import Loss
from lfs10d.outbox.outbox import Outbox
from tests.support.backlogs import MemoryStore, connect, sample
from tests.support.outbox_items import recorded


def test_a_loss_notice_that_cannot_be_sent_waits_again() -> None:
    backlog = Backlog(capacity=10, detection=40.0)
    notice = LossNotice(Loss("a", "k", 1, 2, 2))
    backlog.dead(notice)
    assert backlog.losses.undeclared() == [notice.loss]


# Records


def test_records_are_kept_while_the_broker_is_away_and_each_follows_as_a_message_of_its_own() -> None:
    outbox, store = Outbox(), MemoryStore()
    outbox.send_samples(telemetry=False)
    for seq in (1, 2, 3):
        outbox.add(sample(seq), 600.0 * seq)
        outbox.add(recorded(seq), 600.0 * seq)
    assert store.spill(outbox, 1810.0)
    assert len(store.rows) == 3
    connect(outbox, 2000.0)
    store.page(outbox, 2000.0 + HISTORY_AFTER)
    sent = []
    for seq in (1, 2, 3):
        batch = outbox.next(2011.0 + seq)
        assert isinstance(batch, HistoryBatch)
        assert batch.topic == "device/a/record"
        sent.append([each.sample.seq for each in batch.samples])
        outbox.on_ack(batch, 2011.0 + seq)
    assert sent == [[1], [2], [3]]
    assert outbox.next(2020.0) is None


def test_while_samples_are_not_wanted_those_of_the_store_stay_and_records_pass_them() -> None:
    outbox, store = Outbox(), MemoryStore()
    outbox.add(sample(1), 0.0)
    outbox.add(recorded(1), 0.5)
    assert store.spill(outbox, 10.0)
    outbox.send_samples(telemetry=False)
    connect(outbox, 20.0)
    store.page(outbox, 31.0)
    batch = outbox.next(31.0)
    assert isinstance(batch, HistoryBatch)
    assert batch.topic == "device/a/record"
    outbox.on_ack(batch, 31.0)
    assert outbox.next(35.0) is None
    assert outbox.due() is None
    outbox.send_samples(telemetry=True)
    store.page(outbox, 40.0)
    batch = outbox.next(40.0)
    assert isinstance(batch, HistoryBatch)
    assert batch.topic == "device/a/history"


def test_where_records_are_refused_samples_go_on_and_the_other_way_round() -> None:
    for refused, goes in (("device/a/record", "device/a/history"), ("device/a/history", "device/a/record")):
        backlog = Backlog(capacity=100, detection=40.0)
        backlog.connected(-HISTORY_AFTER, 20)
        for waiting in (sample(1), recorded(1)):
            assert waiting.sample is not None
            backlog.history.add(QueuedSample(waiting.sample, 0.0))
        batch = backlog.next(0.0, {refused, "device/a/state"})
        assert isinstance(batch, HistoryBatch)
        assert batch.topic == goes
        assert backlog.next(9.0, {refused}) is None
