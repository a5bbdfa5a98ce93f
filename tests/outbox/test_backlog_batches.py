"""Batches of the backlog that are too large or end their connection are cut."""

from __future__ import annotations

from lfs10d.outbox.items import HistoryBatch, LossNotice
from lfs10d.outbox.losses import Loss
from lfs10d.outbox.outbox import Outbox
from tests.support.backlogs import MemoryStore, away, connect, sample, seqs


def test_a_batch_of_the_store_that_is_too_large_is_cut_and_a_dead_sample_declared_and_let_go() -> None:
    store = MemoryStore()
    outbox = away(2, store)
    connect(outbox, 100.0)
    store.page(outbox, 110.0)
    both = outbox.next(110.0)
    assert isinstance(both, HistoryBatch)
    assert not outbox.unfit(both)
    one = outbox.next(110.0)
    assert isinstance(one, HistoryBatch)
    assert seqs(one) == [1]
    assert outbox.unfit(one)
    notice = outbox.next(110.0)
    assert isinstance(notice, LossNotice)
    assert outbox.backlog.undeclared() == [Loss("a", "k2", 1, 1, 1)]
    outbox.on_ack(notice, 110.0)
    assert seqs(outbox.next(110.2)) == [2]
    store.release(outbox, 110.2)
    assert list(store.rows) == [2]


def test_a_batch_of_memory_that_is_too_large_is_cut() -> None:
    outbox = Outbox()
    for seq in (1, 2, 3, 4):
        outbox.add(sample(seq), 0.0)
    connect(outbox, 10.0)
    batch = outbox.next(20.0)
    assert isinstance(batch, HistoryBatch)
    assert not outbox.unfit(batch)
    assert seqs(outbox.next(20.0)) == [1, 2]


def test_a_batch_that_ended_its_connection_leaves_shorter_ones_after_it_for_a_time_or_until_a_reload() -> None:
    outbox, lengths = Outbox(), []
    for seq in (1, 2, 3, 4):
        outbox.add(sample(seq), 0.0)
    for now in (10.0, 30.0, 100.0, 130.0, 160.0):
        connect(outbox, now)
        batch = outbox.next(now + 10.0)
        assert isinstance(batch, HistoryBatch)
        lengths.append(len(batch.samples))
        if now == 10.0:
            outbox.backlog.cut_for(batch, 90.0)
        if now == 100.0:
            outbox.backlog.cut_for(batch, 1000.0)
        if now == 130.0:
            outbox.backlog.reload()
        outbox.lost(now + 11.0)
    assert lengths == [4, 2, 4, 2, 4]


def test_a_batch_of_the_store_is_shortened_and_refused_without_a_loss() -> None:
    store = MemoryStore()
    outbox = away(5, store)
    connect(outbox, 10.0)
    store.page(outbox, 20.0)
    batch = outbox.next(20.0)
    assert isinstance(batch, HistoryBatch)
    shorter = outbox.backlog.shorten(batch, 2)
    assert seqs(shorter) == [1, 2]
    outbox.backlog.refused(shorter)
    outbox.backlog.over(shorter)
    assert seqs(outbox.next(20.2)) == [1, 2, 3, 4, 5]
