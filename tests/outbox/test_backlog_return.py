"""The broker is back: store first, then memory, and once more what may not have arrived."""

from __future__ import annotations

from lfs10d.outbox.backlog import HISTORY_AFTER
from lfs10d.outbox.items import HistoryBatch, LiveSample
from lfs10d.outbox.outbox import Outbox
from tests.support.backlogs import MemoryStore, away, connect, sample, seqs

# From the store


def test_on_return_the_backlog_comes_from_the_store_first_and_then_from_memory() -> None:
    store = MemoryStore()
    outbox = away(20, store)
    outbox.add(sample(21), 5.0)
    connect(outbox, 8.5)
    assert outbox.backlog.page_due() == 18.5
    assert outbox.due() is None
    assert outbox.next(18.5) is None
    told: list[int] = []
    now = 18.5
    while len(told) < 21:
        store.page(outbox, now)
        due = outbox.due()
        assert due is not None
        now = max(now, due)
        batch = outbox.next(now)
        assert isinstance(batch, HistoryBatch)
        told += seqs(batch)
        outbox.on_ack(batch, now)
    assert told == list(range(1, 22))
    assert outbox.depth == 0
    store.release(outbox, now + 20)
    assert not store.rows


def test_a_loss_in_the_middle_sends_once_more_what_was_acknowledged_lately_and_the_rest_in_order() -> None:
    store = MemoryStore()
    outbox = away(14, store)
    connect(outbox, 100.0)
    store.page(outbox, 110.0)
    first = outbox.next(110.0)
    assert isinstance(first, HistoryBatch)
    outbox.on_ack(first, 110.0)
    store.page(outbox, 110.0)
    assert seqs(outbox.next(110.2)) == list(range(8, 15))
    outbox.lost(111.0)
    assert outbox.depth == 14
    connect(outbox, 112.0)
    store.page(outbox, 122.0, most=100)
    again = outbox.next(122.0)
    assert seqs(again) == list(range(1, 15))
    assert outbox.stats.dropped == 0


def test_samples_of_earlier_boots_come_first_and_never_in_one_batch_with_others() -> None:
    store = MemoryStore()
    before = Outbox()
    for seq in (8, 9):
        before.add(sample(seq, boot="k1"), 0.0)
    assert store.spill(before, 4.0)
    outbox = Outbox()
    store.opened(outbox)
    assert outbox.depth == 2
    outbox.add(sample(1), 0.0)
    store.spill(outbox, 4.0)
    connect(outbox, 5.0)
    store.page(outbox, 15.0)
    told = []
    for now in (15.0, 15.2):
        batch = outbox.next(now)
        assert isinstance(batch, HistoryBatch)
        told.append([(queued.sample.boot, queued.sample.seq) for queued in batch.samples])
        outbox.on_ack(batch, now)
    assert told == [[("k1", 8), ("k1", 9)], [("k2", 1)]]


# The second sending


def heard_by_nobody(outbox: Outbox, now: float) -> None:
    item = outbox.next(now)
    assert isinstance(item, LiveSample)
    outbox.on_ack(item, now, nobody_listens=True)


def test_what_nobody_listened_to_after_the_first_connect_of_a_life_goes_once_more_when_the_backlog_is_opened() -> None:
    outbox = Outbox()
    connect(outbox, 0.0)
    outbox.add(sample(1), 1.0)
    heard_by_nobody(outbox, 1.0)
    outbox.add(sample(2), 2.0)
    live = outbox.next(2.0)
    assert live is not None
    outbox.on_ack(live, 2.0)
    assert outbox.due() == HISTORY_AFTER
    assert outbox.next(HISTORY_AFTER - 0.1) is None
    batch = outbox.next(HISTORY_AFTER)
    assert isinstance(batch, HistoryBatch)
    assert [(queued.sample.seq, queued.repeated) for queued in batch.samples] == [(1, True)]
    outbox.on_ack(batch, HISTORY_AFTER)
    outbox.add(sample(3), 11.0)
    heard_by_nobody(outbox, 11.0)
    assert outbox.due() is None
    assert outbox.next(30.0) is None


def test_what_nobody_listened_to_goes_once_more_only_once_where_the_connection_is_lost_meanwhile() -> None:
    outbox = Outbox()
    connect(outbox, 0.0)
    outbox.add(sample(1), 1.0)
    heard_by_nobody(outbox, 1.0)
    outbox.lost(2.0)
    connect(outbox, 3.0)
    batch = outbox.next(13.0)
    assert seqs(batch) == [1]
    assert batch is not None
    outbox.on_ack(batch, 13.0)
    assert outbox.next(30.0) is None


def test_what_nobody_listened_to_is_not_kept_on_disk_by_a_daemon_that_parts() -> None:
    outbox = Outbox()
    connect(outbox, 0.0)
    outbox.add(sample(1), 1.0)
    heard_by_nobody(outbox, 1.0)
    outbox.backlog.on_clean_exit()
    outbox.lost(2.0)
    assert not outbox.backlog.spill.at_last


def test_the_second_sending_is_due_when_the_backlog_is_opened() -> None:
    outbox = Outbox()
    connect(outbox, 0.0)
    outbox.add(sample(1), 20.0)
    item = outbox.next(20.0)
    assert item is not None
    outbox.on_ack(item, 20.0)
    outbox.lost(21.0)
    connect(outbox, 22.0)
    assert outbox.due() == 22.0 + HISTORY_AFTER
    assert seqs(outbox.next(32.0)) == [1]


def test_what_is_acknowledged_until_the_backlog_is_opened_goes_once_more_and_nothing_after() -> None:
    outbox = Outbox()
    connect(outbox, 0.0)
    outbox.lost(50.0)
    connect(outbox, 60.0)
    for seq, now in ((1, 60.5), (2, 69.5), (3, 80.0)):
        outbox.add(sample(seq), now)
        item = outbox.next(now)
        assert isinstance(item, LiveSample)
        outbox.on_ack(item, now)
    assert seqs(outbox.next(80.0)) == [1, 2]


def test_what_was_acknowledged_before_is_no_loss_when_its_second_sending_is_unfit() -> None:
    outbox = Outbox()
    connect(outbox, 0.0)
    outbox.add(sample(1), 50.0)
    item = outbox.next(50.0)
    assert item is not None
    outbox.on_ack(item, 50.0)
    outbox.lost(51.0)
    connect(outbox, 52.0)
    again = outbox.next(62.0)
    assert isinstance(again, HistoryBatch)
    assert outbox.unfit(again)
    assert outbox.backlog.undeclared() == []
