"""What was under way or just acknowledged when the connection was lost goes once more."""

from __future__ import annotations

from lfs10d.outbox.backlog import HISTORY_AFTER
from lfs10d.outbox.items import HistoryBatch, LiveSample, LossNotice, Message
from lfs10d.outbox.losses import Loss
from lfs10d.outbox.message_queue import MESSAGES_MOST
from lfs10d.outbox.outbox import Outbox
from tests.support.outbox_items import named_event
from tests.support.outboxes import (
    connect,
    connected,
    sample,
    seqs,
    take,
    trace,
)

# Loss of the connection


def test_what_is_under_way_when_the_connection_is_lost_waits_again_in_order() -> None:
    outbox = connected()
    for seq in range(1, 4):
        outbox.add(sample(seq), 0.0)
    take(outbox, 0.0, LiveSample)
    take(outbox, 0.0, LiveSample)
    outbox.lost(0.1)
    assert tuple(outbox._in_flight) == ()
    connect(outbox, 0.2)
    assert [seqs(outbox.next(0.2)) for _ in range(3)] == [[1], [2], [3]]


def test_a_batch_under_way_when_the_connection_is_lost_waits_again() -> None:
    outbox = Outbox()
    outbox.add(sample(1), 0.0)
    connect(outbox, 10.0)
    take(outbox, 20.0, HistoryBatch)
    outbox.lost(21.0)
    connect(outbox, 22.0)
    assert seqs(outbox.next(32.0)) == [1]


def test_an_unfit_batch_is_declared_but_for_what_was_acknowledged_before() -> None:
    outbox = connected(now=-100.0)
    outbox.add(sample(1), 0.0)
    outbox.on_ack(take(outbox, 0.0, LiveSample), 0.0)
    outbox.lost(1.0)
    outbox.add(sample(2), 1.0)
    connect(outbox, 10.0)
    batch = take(outbox, 20.0, HistoryBatch)
    assert seqs(batch) == [1, 2]
    assert not outbox.unfit(batch)
    for seq in (1, 2):
        one = take(outbox, 20.0 + seq, HistoryBatch)
        assert seqs(one) == [seq]
        assert outbox.unfit(one) is (seq == 1)
    assert take(outbox, 23.0, LossNotice).loss == Loss("a", "k", 2, 2, 1)


def test_messages_under_way_wait_again_in_order_and_traces_do_not() -> None:
    outbox = connected()
    for number in range(3):
        outbox.add(named_event(f"e{number}"), 0.0)
    outbox.add(trace(1), 0.0)
    outbox.add(trace(2), 0.0)
    for _ in range(2):
        take(outbox, 0.0, Message)
    outbox.lost(0.1)
    outbox.add(trace(3), 0.2)
    connect(outbox, 1.0)
    told = []
    while (item := outbox.next(1.0)) is not None:
        assert isinstance(item, Message)
        told.append(item.publication)
    assert told == [named_event(f"e{number}") for number in range(3)]


def test_a_trace_under_way_is_gone() -> None:
    outbox = connected()
    outbox.add(trace(1), 0.0)
    take(outbox, 0.0, Message)
    outbox.lost(0.1)
    connect(outbox, 1.0)
    assert outbox.next(1.0) is None


def test_messages_that_wait_are_bounded() -> None:
    outbox = connected()
    outbox.add(named_event("first"), 0.0)
    take(outbox, 0.0, Message)
    for number in range(MESSAGES_MOST + 5):
        outbox.add(named_event(f"e{number}"), 0.0)
    outbox.lost(1.0)
    connect(outbox, 2.0, window=MESSAGES_MOST * 2)
    count = 0
    while outbox.next(2.0) is not None:
        count += 1
    assert count == MESSAGES_MOST


def test_what_was_acknowledged_around_a_loss_goes_once_more_ten_seconds_after_the_reconnect() -> None:
    outbox = connected(now=-100.0)
    for seq, now in ((1, 0.0), (2, 15.0), (3, 24.0)):
        outbox.add(sample(seq), now)
        outbox.on_ack(take(outbox, now, LiveSample), now)
    outbox.lost(25.0)
    outbox.add(sample(4), 26.0)
    connect(outbox, 40.0)
    outbox.add(sample(5), 45.0)
    outbox.on_ack(take(outbox, 45.0, LiveSample), 45.0)
    batch = take(outbox, 50.0, HistoryBatch)
    assert seqs(batch) == [2, 3, 4, 5]
    outbox.on_ack(batch, 50.0)
    assert outbox.next(51.0) is None
    assert outbox.depth == 0


def test_there_is_no_second_sending_without_a_loss() -> None:
    outbox = connected(now=0.0)
    outbox.add(sample(1), 5.0)
    outbox.on_ack(take(outbox, 5.0, LiveSample), 5.0)
    assert outbox.next(20.0) is None
    assert outbox.due() is None


def test_the_second_sending_is_due_by_time_alone() -> None:
    outbox = connected(now=0.0)
    outbox.add(sample(1), 5.0)
    outbox.on_ack(take(outbox, 5.0, LiveSample), 5.0)
    outbox.lost(6.0)
    connect(outbox, 7.0)
    assert outbox.due() == 7.0 + HISTORY_AFTER


def test_a_connection_found_dead_late_still_repeats_the_last_ten_seconds_it_acknowledged() -> None:
    outbox = connected(now=-100.0)
    for now in (0.0, 6.0):
        outbox.add(sample(int(now) + 1), now)
        outbox.on_ack(take(outbox, now, LiveSample), now)
    outbox.lost(45.0)
    connect(outbox, 46.0)
    assert seqs(outbox.next(56.0)) == [1, 7]


def test_what_was_acknowledged_long_before_a_loss_does_not_go_again() -> None:
    outbox = Outbox(detection=40.0)
    connect(outbox, -100.0)
    outbox.add(sample(1), 0.0)
    outbox.on_ack(take(outbox, 0.0, LiveSample), 0.0)
    outbox.lost(1000.0)
    connect(outbox, 1001.0)
    assert outbox.next(1011.0) is None


def test_a_second_loss_before_the_second_sending_forgets_nothing() -> None:
    outbox = connected(now=-100.0)
    outbox.add(sample(1), 0.0)
    outbox.on_ack(take(outbox, 0.0, LiveSample), 0.0)
    outbox.lost(1.0)
    connect(outbox, 5000.0)
    outbox.lost(5001.0)
    connect(outbox, 9000.0)
    assert seqs(outbox.next(9010.0)) == [1]
