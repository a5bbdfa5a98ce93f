"""The backlog: what the store takes and gives back, in virtual time, with a store in memory beside it."""

from __future__ import annotations

from lfs10d.outbox.backlog import HISTORY_AFTER
from lfs10d.outbox.items import LiveSample, samples_of
from lfs10d.outbox.losses import Loss
from lfs10d.outbox.outbox import Outbox
from lfs10d.outbox.spill import AWAY_AFTER, SPILL_EVERY, SPILL_MOST
from lfs10d.outbox.store.sample_file import StoredRow
from lfs10d.telemetry.publication import (
    BacklogStats,
    Publication,
    Sample,
)
from tests.support.backlogs import MemoryStore, connect, sample, seqs

# To the store


def test_before_the_first_connect_what_is_older_than_three_seconds_is_kept_at_once_then_every_five() -> None:
    outbox, store = Outbox(), MemoryStore()
    outbox.add(sample(1), 0.0)
    assert not store.spill(outbox, 3.0)
    assert outbox.next_old() == 3.0
    assert store.spill(outbox, 3.1)
    outbox.add(sample(2), 3.1)
    outbox.age(7.0)
    assert outbox.backlog.spill.due() == 3.1 + SPILL_EVERY
    assert not store.spill(outbox, 8.0)
    assert store.spill(outbox, 8.1)
    assert len(store.rows) == 2
    assert outbox.stats == BacklogStats(depth=2, oldest_ts=1000, dropped=0)


def test_a_broker_that_is_back_within_three_seconds_costs_no_write() -> None:
    outbox, store = Outbox(), MemoryStore()
    connect(outbox, 0.0)
    outbox.add(sample(1), 98.0)
    outbox.lost(100.0)
    outbox.age(102.9)
    assert outbox.backlog.spill.due() == 100.0 + AWAY_AFTER
    connect(outbox, 102.95)
    assert not store.spill(outbox, 500.0)


def test_what_is_to_be_sent_again_is_kept_before_what_came_later() -> None:
    outbox, store = Outbox(), MemoryStore()
    connect(outbox, 0.0)
    outbox.add(sample(1), 20.0)
    item = outbox.next(20.0)
    assert item is not None
    outbox.on_ack(item, 20.0)
    outbox.lost(21.0)
    outbox.add(sample(2), 21.0)
    assert store.spill(outbox, 25.0)
    assert [(row.sample.seq, row.repeated) for row in store.rows.values()] == [(1, True), (2, False)]
    assert outbox.depth == 2


def test_much_that_waits_is_kept_in_several_commits_without_a_pause() -> None:
    outbox, store = Outbox(), MemoryStore()
    for seq in range(1, SPILL_MOST + 2):
        outbox.add(sample(seq), 0.0)
    assert [store.spill(outbox, 4.0) for _ in range(3)] == [True, True, False]
    assert len(store.rows) == SPILL_MOST + 1


def test_while_one_commit_is_under_way_no_other_begins() -> None:
    outbox = Outbox()
    outbox.add(sample(1), 0.0)
    outbox.age(4.0)
    outbox.backlog.spill.take()
    outbox.add(sample(2), 4.0)
    outbox.age(10.0)
    assert outbox.backlog.spill.due() is None
    assert outbox.depth == 2
    assert outbox.stats.oldest_ts == 1000


def test_what_the_store_cannot_take_waits_in_memory_and_is_tried_again_five_seconds_later() -> None:
    outbox, store = Outbox(capacity=3), MemoryStore(broken=True)
    for seq in range(1, 5):
        outbox.add(sample(seq), 0.0)
    assert store.spill(outbox, 4.0)
    assert (outbox.depth, outbox.stats.dropped) == (3, 1)
    assert not store.spill(outbox, 8.9)
    store.broken = False
    assert store.spill(outbox, 9.0)
    assert [row.sample.seq for row in store.rows.values()] == [2, 3, 4]
    assert store.losses == (Loss("a", "k2", 1, 1, 1),)


def test_where_the_broker_is_too_slow_half_the_memory_is_the_most_that_waits_there() -> None:
    outbox, store = Outbox(capacity=10), MemoryStore()
    connect(outbox, -100.0)
    for seq in range(1, 7):
        outbox.add(sample(seq), 0.0)
    assert store.spill(outbox, 4.0)
    assert outbox.backlog.page_due() == -100.0 + HISTORY_AFTER
    assert store.page(outbox, 4.0)
    assert seqs(outbox.next(4.0)) == [1, 2, 3, 4, 5, 6]


def test_the_past_may_be_opened_earlier() -> None:
    outbox, store = Outbox(history_wait=2.0), MemoryStore()
    connect(outbox, 10.0)
    outbox.add(sample(1), 0.0)
    outbox.age(11.0)
    assert not store.page(outbox, 11.0)
    assert outbox.next(11.9) is None
    assert outbox.due() == 12.0
    assert seqs(outbox.next(12.0)) == [1]


# The clock


def test_a_clock_set_right_corrects_what_waits_wherever_it_waits_and_nothing_else() -> None:
    outbox = Outbox()
    outbox.add(sample(1, clock="unsynced"), 0.0, shift=0)
    outbox.age(4.0)
    outbox.backlog.spill.take()
    outbox.add(sample(2, clock="unsynced"), 4.0, shift=0)
    outbox.age(8.0)
    outbox.add(sample(3, clock="unsynced"), 8.0, shift=500)
    outbox.add(sample(4), 8.0, shift=7000)
    ours, earlier = sample_of(sample(9, clock="unsynced")), sample_of(sample(8))
    outbox.backlog.spool.take_page(
        [StoredRow(1, ours, 0, repeated=False), StoredRow(2, earlier, None, repeated=False)], 9
    )
    outbox.correct(7000)
    outbox.not_spilled(8.0)
    connect(outbox, 8.1)
    live = [outbox.next(8.1), outbox.next(8.1)]
    told = []
    for item in live:
        assert isinstance(item, LiveSample)
        payload = item.publication.payload
        assert isinstance(payload, dict)
        told.append((payload["seq"], payload["ts"], payload["time"], payload["clock"]))
    assert told == [
        (3, 9500, "1970-01-01T00:00:09.500Z", "synced"),
        (4, 4000, "1970-01-01T00:00:04.000Z", "synced"),
    ]
    page = outbox.next(20.0)
    assert page is not None
    assert [(queued.sample.seq, queued.sample.ts) for queued in samples_of(page)] == [(8, 8000), (9, 16_000)]
    outbox.on_ack(page, 20.0)
    memory = outbox.next(20.2)
    assert memory is not None
    assert [(queued.sample.seq, queued.sample.ts, queued.sample.clock) for queued in samples_of(memory)][:2] == [
        (1, 8000, "synced"),
        (2, 9000, "synced"),
    ]


def sample_of(publication: Publication) -> Sample:
    assert publication.sample is not None
    return publication.sample


# The end


def test_parting_from_a_broker_that_has_answered_leaves_nothing_to_repeat() -> None:
    outbox = Outbox()
    connect(outbox, 0.0)
    outbox.add(sample(1), 20.0)
    item = outbox.next(20.0)
    assert item is not None
    outbox.on_ack(item, 20.0)
    outbox.backlog.on_clean_exit()
    outbox.lost(20.1)
    assert not outbox.backlog.spill.at_last


def test_what_is_still_to_be_repeated_is_kept_at_the_end() -> None:
    outbox, store = Outbox(), MemoryStore()
    connect(outbox, 0.0)
    outbox.add(sample(1), 20.0)
    item = outbox.next(20.0)
    assert item is not None
    outbox.on_ack(item, 20.0)
    outbox.lost(20.1)
    connect(outbox, 21.0)
    outbox.backlog.on_clean_exit()
    outbox.lost(22.0)
    assert outbox.backlog.spill.at_last
    store.take(outbox, 22.0)
    assert [row.repeated for row in store.rows.values()] == [True]


def test_the_broker_is_away_until_it_is_there_and_when_it_is_gone() -> None:
    outbox = Outbox()
    told = [outbox.backlog.spill.away]
    connect(outbox, 0.0)
    told.append(outbox.backlog.spill.away)
    outbox.lost(1.0)
    told.append(outbox.backlog.spill.away)
    assert told == [True, False, True]
    assert outbox.stats == BacklogStats()
