"""The backlog: what the store takes and gives back, in virtual time, with a store in memory beside it."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from lfs10d.outbox.backlog import HISTORY_AFTER, Backlog
from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.items import HistoryBatch, LiveSample, LossNotice, OutboxItem, samples_of
from lfs10d.outbox.losses import DECLARED_EVERY, Loss
from lfs10d.outbox.outbox import Outbox
from lfs10d.outbox.spill import AWAY_AFTER, SPILL_EVERY, SPILL_MOST
from lfs10d.outbox.store.sample_file import StoredRow
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry.publication import (
    TELEMETRY,
    BacklogStats,
    Publication,
    PublicationKind,
    Sample,
    device_topic,
    retained,
)
from tests.support.outbox_items import recorded

NOT_AUTHORIZED, QUOTA_EXCEEDED = 0x87, 0x97
ONLINE = retained("availability", "online")


def sample(seq: int, device: str = "a", *, boot: str = "k2", clock: ClockState = "synced") -> Publication:
    measured = Sample(device, boot, seq, 1000 * seq, clock, None, {}, (), "bad", "timeout", None)
    topic = device_topic(device, TELEMETRY)
    return Publication(topic, measured.payload("line0"), PublicationKind.SAMPLE, retain=False, qos=1, sample=measured)


@dataclass
class MemoryStore:
    """What the store does, without a disk. `room`: rows that fit."""

    room: int = 10**9
    rows: dict[int, StoredRow] = field(default_factory=dict)
    next: int = 1
    losses: tuple[Loss, ...] = ()
    broken: bool = False

    def spill(self, outbox: Outbox, now: float) -> bool:
        """Do what is due; return True if something was."""
        outbox.age(now)
        due = outbox.backlog.spill.due()
        if due is None or due > now:
            return False
        self.take(outbox, now)
        return True

    def take(self, outbox: Outbox, now: float) -> None:
        """Take what waits in memory."""
        backlog = outbox.backlog
        queued = backlog.spill.take()
        if self.broken:
            outbox.not_spilled(now)
            return
        delivered, evicted = backlog.spool.delivered, []
        for each in queued:
            self.rows[self.next] = StoredRow(self.next, each.sample, each.shift, each.repeated)
            self.next += 1
        for number in [number for number in self.rows if number > backlog.beyond]:
            if len(self.rows) <= self.room:
                break
            row = self.rows.pop(number)
            if not row.repeated and number not in delivered:
                evicted.append(Loss(row.sample.device, row.sample.boot, row.sample.seq, row.sample.seq, 1))
        self.losses = (*backlog.undeclared(), *evicted)
        self.tell(outbox)
        backlog.spilled(tuple(evicted), now)

    def page(self, outbox: Outbox, now: float, most: int = 7) -> bool:
        """Give a page if one is due; return True if one was."""
        backlog = outbox.backlog
        due = backlog.page_due()
        if due is None or due > now or self.broken:
            return False
        found = [row for number, row in sorted(self.rows.items()) if number > backlog.spool.after]
        backlog.spool.take_page(found[:most], most)
        return True

    def release(self, outbox: Outbox, now: float) -> None:
        """Delete what is due."""
        due = outbox.backlog.spool.release_due()
        if due is None or due > now or self.broken:
            return
        gone = outbox.backlog.spool.releasing(now)
        for number in gone:
            self.rows.pop(number, None)
        self.losses = tuple(outbox.backlog.undeclared())
        outbox.backlog.spool.deleted(gone)
        self.tell(outbox)

    def tell(self, outbox: Outbox) -> None:
        """Tell what there is."""
        first = next((row.sample.ts for _, row in sorted(self.rows.items())), None)
        outbox.backlog.spool.update(len(self.rows), first)

    def opened(self, outbox: Outbox) -> None:
        """Begin with an outbox of the next life."""
        self.tell(outbox)
        outbox.backlog.spool.more = bool(self.rows)
        for loss in self.losses:
            outbox.backlog.losses.restore(loss)


def connect(outbox: Outbox, now: float) -> None:
    outbox.connected(now)
    outbox.burst([], ONLINE)
    while not outbox.announced:
        item = outbox.next(now)
        assert item is not None
        outbox.on_ack(item, now)


def seqs(item: OutboxItem | None) -> list[int]:
    assert item is not None
    return [queued.sample.seq for queued in samples_of(item)]


def away(count: int, store: MemoryStore) -> Outbox:
    """Return an outbox whose samples of 0.0 s are all in the store."""
    outbox = Outbox()
    for seq in range(1, count + 1):
        outbox.add(sample(seq), 0.0)
    while store.spill(outbox, 4.0):
        pass
    return outbox


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
    assert (outbox.depth, outbox.dropped) == (3, 1)
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
    assert outbox.dropped == 0


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
    outbox.backlog.part()
    outbox.lost(2.0)
    assert not outbox.backlog.spill.at_last


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
    outbox.backlog.part()
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
    outbox.backlog.part()
    outbox.lost(22.0)
    assert outbox.backlog.spill.at_last
    store.take(outbox, 22.0)
    assert [row.repeated for row in store.rows.values()] == [True]


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
    assert outbox.dropped == 0


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


def test_the_broker_is_away_until_it_is_there_and_when_it_is_gone() -> None:
    outbox = Outbox()
    told = [outbox.backlog.spill.away]
    connect(outbox, 0.0)
    told.append(outbox.backlog.spill.away)
    outbox.lost(1.0)
    told.append(outbox.backlog.spill.away)
    assert told == [True, False, True]
    assert outbox.stats == BacklogStats()


# Laws


class PastLaws(RuleBasedStateMachine):
    """Whatever happens to broker, disk and daemon: every sample is delivered or declared, and in order.

    None is delivered twice but where a connection was lost within 10 s of its acknowledgement.
    """

    CAPACITY = 20
    ROOM = 40

    def __init__(self) -> None:
        super().__init__()
        self.store = MemoryStore(room=self.ROOM)
        self.now = 0.0
        self.life = 0
        self.online = False
        self.measured: set[tuple[str, str, int]] = set()
        self.delivered: dict[tuple[str, str, int], list[float]] = {}
        self.declared: list[Loss] = []
        self.losses_at: list[float] = []
        self.connects_at: list[float] = []
        self.begin()

    def begin(self) -> None:
        self.life += 1
        self.outbox = Outbox(capacity=self.CAPACITY, detection=1.0)
        self.store.opened(self.outbox)
        self.seqs = {"a": 0, "b": 0}

    @rule(device=st.sampled_from("ab"), count=st.integers(1, 12))
    def measure(self, device: str, count: int) -> None:
        for _ in range(count):
            self.seqs[device] += 1
            self.outbox.add(sample(self.seqs[device], device, boot=f"k{self.life:04}"), self.now)
            self.measured.add((device, f"k{self.life:04}", self.seqs[device]))

    @rule(seconds=st.sampled_from([0.1, 1.0, 3.5, 6.0, 12.0, 70.0]))
    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.keep()

    def keep(self) -> None:
        while self.store.spill(self.outbox, self.now) and not self.store.broken:
            pass
        self.store.release(self.outbox, self.now)
        self.store.page(self.outbox, self.now)

    @rule(broken=st.booleans())
    def disk(self, broken: bool) -> None:  # noqa: FBT001 - drawn by hypothesis
        self.store.broken = broken

    @precondition(lambda self: not self.online)
    @rule()
    def connect(self) -> None:
        connect(self.outbox, self.now)
        self.connects_at.append(self.now)
        self.online = True

    @precondition(lambda self: self.online)
    @rule()
    def lose(self) -> None:
        self.outbox.lost(self.now)
        self.losses_at.append(self.now)
        self.online = False

    @precondition(lambda self: self.online and self.outbox.under_way)
    @rule(denied=st.booleans())
    def throw_out(self, denied: bool) -> None:  # noqa: FBT001 - drawn by hypothesis
        """End the connection for what is under way, as the broker does."""
        sent = {item.topic: 100 for item in self.outbox.under_way}
        self.outbox.lost(self.now, self.outbox.suspects.ended(sent, certain=denied), denied=denied)
        self.losses_at.append(self.now)
        self.online = False

    @precondition(lambda self: not self.online and not self.store.broken)
    @rule()
    def restart(self) -> None:
        """End in order while the broker is away, and begin anew."""
        self.outbox.age(float("inf"))
        while self.outbox.backlog.spill.at_last:
            self.store.take(self.outbox, self.now)
        self.store.losses = tuple(self.outbox.backlog.undeclared())
        gone = self.outbox.backlog.spool.releasing(self.now)
        for number in gone:
            self.store.rows.pop(number, None)
        self.begin()

    @precondition(lambda self: self.online)
    @rule(fate=st.sampled_from(["settled", "settled", "settled", "settled", "refused", "denied", "unfit", "nothing"]))
    def go(self, fate: str) -> None:
        item = self.outbox.next(self.now)
        if item is None or fate == "nothing":
            return
        if fate == "refused":
            self.outbox.refused(item, QUOTA_EXCEEDED, self.now)
        elif fate == "denied":
            self.outbox.refused(item, NOT_AUTHORIZED, self.now)
        elif fate == "unfit":
            self.outbox.unfit(item)
        else:
            self.settle(item)

    def settle(self, item: OutboxItem) -> None:
        if isinstance(item, HistoryBatch):
            queued = [(each.sample.boot, each.sample.seq) for each in item.samples]
            assert queued == sorted(set(queued))
            assert len({each.key for each in item.samples}) == 1
        self.outbox.on_ack(item, self.now)
        for each in samples_of(item):
            key = (each.sample.device, each.sample.boot, each.sample.seq)
            self.delivered.setdefault(key, []).append(self.now)
        if isinstance(item, LossNotice):
            self.declared.append(item.loss)

    @invariant()
    def memory_is_bounded(self) -> None:
        in_memory = self.outbox.depth - self.outbox.backlog.spool.depth
        assert in_memory <= self.CAPACITY + sum(len(samples_of(each)) for each in self.outbox.under_way)
        assert len(self.store.rows) <= self.ROOM + 7

    def teardown(self) -> None:
        """Let everything go: then all is accounted for."""
        self.store.broken = False
        if not self.online:
            connect(self.outbox, self.now)
        for item in self.outbox.under_way:
            self.settle(item)
        self.outbox.reload(self.now)
        self.now += HISTORY_AFTER + DECLARED_EVERY
        for _ in range(3000):
            self.keep()
            taken = self.outbox.next(self.now)
            if taken is not None:
                self.settle(taken)
                continue
            due = [each for each in (self.outbox.due(), self.outbox.backlog.spool.release_due()) if each is not None]
            if not due and self.outbox.backlog.page_due() is None:
                break
            self.now = max([self.now, *due[:1]]) if self.outbox.due() is not None else self.now + 1.0
        assert self.outbox.depth == 0
        assert not self.store.rows
        covered = {
            (loss.source, loss.boot, seq) for loss in self.declared for seq in range(loss.from_seq, loss.to_seq + 1)
        }
        assert self.measured <= set(self.delivered) | covered
        assert set(self.delivered) <= self.measured
        count = sum(loss.count for loss in self.declared)
        assert count >= len(self.measured - set(self.delivered))
        if self.life == 1:  # a new life does not know what was acknowledged shortly before
            assert count == len(self.measured - set(self.delivered)) == self.outbox.dropped
        for times in self.delivered.values():
            for before, after in pairwise(times):
                # A loss between the two, not longer than 10 s and the time to notice it after the first; or a
                # reconnect not longer than 10 s before the first.
                lately = any(before - HISTORY_AFTER <= connected <= before for connected in self.connects_at[1:])
                assert lately or any(before - HISTORY_AFTER - 13 <= lost <= after for lost in self.losses_at)


PastLaws.TestCase.settings = settings(max_examples=150, stateful_step_count=60, deadline=None)

TestPastLaws = PastLaws.TestCase


def test_a_loss_notice_that_cannot_be_sent_waits_again() -> None:
    backlog = Backlog(capacity=10, detection=40.0)
    notice = LossNotice(Loss("a", "k", 1, 2, 2))
    backlog.dead(notice)
    assert backlog.losses.waiting() == [notice.loss]


# Records


def test_records_are_kept_while_the_broker_is_away_and_each_follows_as_a_message_of_its_own() -> None:
    outbox, store = Outbox(), MemoryStore()
    outbox.telemetry = False
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
    outbox.telemetry = False
    connect(outbox, 20.0)
    store.page(outbox, 31.0)
    batch = outbox.next(31.0)
    assert isinstance(batch, HistoryBatch)
    assert batch.topic == "device/a/record"
    outbox.on_ack(batch, 31.0)
    assert outbox.next(35.0) is None
    assert outbox.due() is None
    outbox.telemetry = True
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
