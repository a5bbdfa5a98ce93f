"""What grew old in memory leaves as history, in batches, after a while, within a capacity."""

from __future__ import annotations

import pytest

from lfs10d.outbox.backlog import BATCH_MOST, HISTORY_AFTER, SAMPLE_EVERY, TURN_EVERY
from lfs10d.outbox.items import HistoryBatch, LiveSample, LossNotice, Retained
from lfs10d.outbox.live_queue import LIVE_FOR
from lfs10d.outbox.losses import Loss
from lfs10d.outbox.outbox import Outbox
from lfs10d.telemetry import publication as telemetry
from tests.support.outboxes import (
    connect,
    connected,
    sample,
    seqs,
    state,
    take,
)

BATCH_EVERY = BATCH_MOST * SAMPLE_EVERY


# Samples that grow old


def test_a_sample_older_than_three_seconds_is_history() -> None:
    outbox = connected(now=-100.0)
    outbox.add(sample(1), 0.0)
    outbox.add(sample(2), 0.1)
    live = outbox.next(LIVE_FOR + 0.05)
    assert isinstance(live, LiveSample)
    assert seqs(live) == [2]
    assert seqs(take(outbox, LIVE_FOR + 0.05, HistoryBatch)) == [1]


def test_the_backlog_is_opened_ten_seconds_after_a_connect() -> None:
    outbox = Outbox()
    outbox.add(sample(1), 0.0)
    connect(outbox, 100.0)
    assert outbox.next(100.0 + HISTORY_AFTER - 0.01) is None
    assert outbox.due() == 100.0 + HISTORY_AFTER
    batch = take(outbox, 100.0 + HISTORY_AFTER, HistoryBatch)
    assert batch.topic == "device/a/history"


def test_a_batch_has_at_most_100_samples_of_one_device_in_order() -> None:
    outbox = Outbox()
    for seq in range(1, 151):
        outbox.add(sample(seq, "a"), 0.0)
        outbox.add(sample(seq, "b"), 0.0)
    connect(outbox, 50.0)
    now, batches = 60.0, []
    while outbox.depth:
        item = take(outbox, now, HistoryBatch)
        assert len({queued.sample.device for queued in item.samples}) == 1
        batches.append((item.topic, seqs(item)))
        outbox.on_ack(item, now)
        now += BATCH_EVERY
    assert sorted(len(each) for _, each in batches) == [50, 50, BATCH_MOST, BATCH_MOST]
    for device in "ab":
        told = [seq for topic, each in batches if topic == f"device/{device}/history" for seq in each]
        assert told == list(range(1, 151))


def test_one_batch_is_under_way_at_a_time_and_a_thousand_samples_leave_in_a_second() -> None:
    outbox = Outbox()
    for seq in range(1, 301):
        outbox.add(sample(seq), 0.0)
    connect(outbox, 50.0)
    first = take(outbox, 60.0, HistoryBatch)
    assert outbox.next(60.5) is None
    assert outbox.due() == 60.0 + TURN_EVERY  # contract, section 3: one batch at least every 2 s, whatever is under way
    outbox.on_ack(first, 60.05)
    assert outbox.next(60.05) is None
    assert outbox.due() == 60.0 + BATCH_EVERY
    assert isinstance(outbox.next(60.0 + BATCH_EVERY), HistoryBatch)


def test_live_samples_go_before_the_backlog() -> None:
    outbox = Outbox()
    outbox.add(sample(1), 0.0)
    connect(outbox, 50.0)
    outbox.add(sample(2), 60.0)
    assert isinstance(outbox.next(60.0), LiveSample)
    assert isinstance(outbox.next(60.0), HistoryBatch)


# No room


def test_beyond_the_capacity_the_oldest_is_dropped_and_declared_before_the_backlog() -> None:
    outbox = Outbox(capacity=3)
    for seq in range(1, 7):
        outbox.add(sample(seq), float(seq))
    assert outbox.stats == telemetry.BacklogStats(depth=3, oldest_ts=4000, dropped=3)
    connect(outbox, 100.0)
    assert outbox.due() == 110.0
    notice = take(outbox, 110.0, LossNotice)
    assert (notice.topic, notice.loss) == ("event", Loss("a", "k", 1, 3, 3))
    assert outbox.next(110.0) is None
    outbox.on_ack(notice, 110.0)
    assert seqs(outbox.next(110.0)) == [4, 5, 6]


def test_live_samples_are_dropped_where_there_are_no_older_ones() -> None:
    outbox = Outbox(capacity=2)
    for seq in range(1, 4):
        outbox.add(sample(seq), 0.0)
    assert (outbox.depth, outbox.stats.dropped) == (2, 1)


def test_what_is_only_repeated_goes_first_and_is_no_loss() -> None:
    outbox = connected(now=-100.0, capacity=4)
    for seq in (1, 2):
        outbox.add(sample(seq), 0.0)
        outbox.on_ack(take(outbox, 0.0, LiveSample), 0.0)
    outbox.lost(1.0)
    for seq in (3, 4, 5):
        outbox.add(sample(seq), 2.0)
    connect(outbox, 10.0)
    assert seqs(outbox.next(20.0)) == [3, 4, 5]
    assert outbox.stats.dropped == 0


def test_a_declaration_that_is_not_acknowledged_is_made_again() -> None:
    outbox = Outbox(capacity=1)
    for seq in (1, 2):
        outbox.add(sample(seq), 0.0)
    connect(outbox, 10.0)
    first = take(outbox, 20.0, LossNotice)
    outbox.lost(21.0)
    connect(outbox, 30.0)
    assert take(outbox, 40.0, LossNotice).loss == first.loss


def test_what_is_under_way_is_never_dropped() -> None:
    outbox = connected(capacity=1)
    outbox.add(sample(1), 0.0)
    live = take(outbox, 0.0, LiveSample)
    outbox.add(sample(2), 0.0)
    assert tuple(outbox._in_flight) == (live,)
    assert outbox.depth == 1
    assert outbox.stats.dropped == 1


@pytest.mark.parametrize("count", [1, 99, 100, 101, 250])
def test_a_backlog_of_any_length_leaves_whole(count: int) -> None:
    outbox = Outbox()
    for seq in range(1, count + 1):
        outbox.add(sample(seq), 0.0)
    connect(outbox, 50.0)
    now, told = 60.0, []
    while (item := outbox.next(now)) is not None:
        told += seqs(item)
        outbox.on_ack(item, now)
        now += BATCH_EVERY
    assert told == list(range(1, count + 1))


def test_without_telemetry_samples_are_not_taken_and_the_backlog_stays_where_it_is() -> None:
    outbox = Outbox()
    outbox.add(sample(1), 0.0)
    connect(outbox, 50.0)
    outbox.send_samples(telemetry=False)
    outbox.add(sample(2), 55.0)
    assert outbox.next(60.0) is None
    assert outbox.due() is None
    assert not outbox.waits
    outbox.add(state(1), 61.0)
    assert take(outbox, 61.0, Retained).topic == "device/a/state"
    outbox.send_samples(telemetry=True)
    assert seqs(take(outbox, 62.0, HistoryBatch)) == [1]
