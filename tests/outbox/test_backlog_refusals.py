"""History or events that the broker refuses wait, in the store too."""

from __future__ import annotations

from lfs10d.outbox.items import HistoryBatch, LossNotice
from lfs10d.outbox.losses import Loss
from lfs10d.outbox.outbox import Outbox
from tests.support.backlogs import QUOTA_EXCEEDED, MemoryStore, connect, sample, seqs

# Refused


def test_where_history_is_refused_the_store_keeps_it_and_the_others_go_on() -> None:
    store = MemoryStore()
    outbox = Outbox()
    for seq in range(1, 5):
        outbox.add(sample(seq), 0.0)
        outbox.add(sample(seq, "b"), 0.0)
    assert store.spill(outbox, 4.0)
    connect(outbox, 10.0)
    store.page(outbox, 20.0)  # both in one, and one row more after it
    batch = outbox.next(20.0)
    assert isinstance(batch, HistoryBatch)
    assert outbox.refused(batch, 0x87, 20.0)
    for now in (20.2, 20.4):
        other = outbox.next(now)
        assert isinstance(other, HistoryBatch)
        assert other.topic == "device/b/history"
        outbox.on_ack(other, now)
        assert outbox.next(now + 0.1) is None
        store.page(outbox, now + 0.1)
    assert outbox.due() is None
    outbox.add(sample(5, "b"), 21.0)
    outbox.add(sample(5), 21.0)
    outbox.age(30.0)
    assert seqs(outbox.next(30.0)) == [5]  # of b: what waits in memory goes too
    assert outbox.depth == 6
    assert outbox.reload(31.0)
    store.release(outbox, 31.0)
    assert store.page(outbox, 31.0)
    again = outbox.next(31.0)
    assert again is None  # the one of b is under way
    outbox.lost(32.0)
    connect(outbox, 33.0)
    store.page(outbox, 43.0, most=20)
    assert seqs(outbox.next(43.0)) == [1, 2, 3, 4]
    assert outbox.stats.dropped == 0


def test_a_topic_that_is_tried_again_on_the_same_connection_gets_what_it_missed_once() -> None:
    store = MemoryStore()
    outbox = Outbox()
    for seq in range(1, 5):
        outbox.add(sample(seq), 0.0)
        outbox.add(sample(seq, "b"), 0.0)
    assert store.spill(outbox, 4.0)
    connect(outbox, 10.0)
    store.page(outbox, 20.0, most=20)
    batch = outbox.next(20.0)
    assert isinstance(batch, HistoryBatch)
    assert outbox.refused(batch, QUOTA_EXCEEDED, 20.0)
    other = outbox.next(20.2)
    assert isinstance(other, HistoryBatch)
    outbox.on_ack(other, 20.2)
    assert outbox.next(20.4) is None
    assert (outbox.due(), outbox.depth) == (21.0, 4)
    assert outbox.next(21.0) is None
    assert store.page(outbox, 21.0, most=20)
    last = outbox.next(21.2)
    assert isinstance(last, HistoryBatch)
    assert (last.topic, seqs(last)) == ("device/a/history", [1, 2, 3, 4])
    outbox.on_ack(last, 21.2)
    assert (outbox.next(22.0), outbox.depth) == (None, 0)


def lost_three() -> Outbox:
    """Return a connected outbox that has lost three samples."""
    outbox = Outbox()
    outbox.backlog.losses.restore(Loss("a", "k2", 1, 3, 3))
    connect(outbox, 10.0)
    return outbox


def test_what_would_be_refused_is_not_sent_and_waits() -> None:
    outbox = Outbox()
    outbox.add(sample(1), 0.0)
    connect(outbox, 10.0)
    batch = outbox.next(20.0)
    assert isinstance(batch, HistoryBatch)
    assert outbox.refused(batch, 0x87, 20.0)
    outbox.add(sample(4), 20.0)
    outbox.age(30.0)
    assert outbox.next(30.0) is None
    assert (outbox.backlog.undeclared(), outbox.depth) == ([], 2)


def test_where_events_are_refused_losses_wait_and_the_backlog_goes_on() -> None:
    outbox = lost_three()
    notice = outbox.next(20.0)
    assert isinstance(notice, LossNotice)
    assert outbox.refused(notice, 0x87, 20.0)
    outbox.add(sample(1, "b"), 20.0)
    outbox.age(30.0)
    assert outbox.due() == 20.0
    assert seqs(outbox.next(30.0)) == [1]
    assert outbox.due() is None
    assert outbox.backlog.undeclared() == [Loss("a", "k2", 1, 3, 3)]


def test_losing_a_connection_that_never_was_is_no_new_absence() -> None:
    outbox, store = Outbox(), MemoryStore()
    outbox.add(sample(1), 0.0)
    outbox.lost(3.5)
    assert store.spill(outbox, 3.6)


def test_a_declaration_under_way_is_made_again_after_a_loss_and_kept_until_then() -> None:
    outbox = lost_three()
    assert isinstance(outbox.next(30.0), LossNotice)
    assert outbox.backlog.undeclared() == [Loss("a", "k2", 1, 3, 3)]
    outbox.lost(31.0)
    assert outbox.backlog.undeclared() == [Loss("a", "k2", 1, 3, 3)]
    connect(outbox, 32.0)
    assert isinstance(outbox.next(42.0), LossNotice)
