"""Messages that end connections or are too large: found, cut, declared; the rest comes through."""

from __future__ import annotations

from lfs10d.outbox.backlog import HISTORY_AFTER
from lfs10d.outbox.items import HistoryBatch, LiveSample, LossNotice, Message, Retained
from lfs10d.outbox.losses import Loss
from lfs10d.outbox.outbox import Outbox
from lfs10d.outbox.refusals import BANNED_FOR
from tests.support.outbox_items import named_event
from tests.support.outboxes import (
    ONLINE,
    connect,
    connected,
    end,
    sample,
    seqs,
    state,
    take,
    under_way,
)


def test_a_batch_that_ends_two_connections_is_cut_over_connects_until_a_reload() -> None:
    outbox, found = Outbox(), []
    for seq in range(1, 5):
        outbox.add(sample(seq), 0.0)
    for now in (100.0, 200.0, 300.0):
        connect(outbox, now)
        batch = take(outbox, now + HISTORY_AFTER, HistoryBatch)
        found.append((len(batch.samples), end(outbox, now + 20, under_way(outbox))))
    assert found == [(4, None), (4, "device/a/history"), (2, "device/a/history")]
    assert outbox.stats.dropped == 0
    connect(outbox, 400.0)
    assert seqs(outbox.next(410.0)) == [1]
    outbox.reload(411.0)
    outbox.lost(412.0)
    connect(outbox, 500.0)
    assert seqs(outbox.next(510.0)) == [1, 2, 3, 4]


def test_a_single_sample_that_ends_connections_is_declared_and_its_topic_rests_for_an_hour() -> None:
    outbox = Outbox()
    outbox.add(sample(1), 0.0)
    for now in (100.0, 200.0):
        connect(outbox, now)
        take(outbox, now + HISTORY_AFTER, HistoryBatch)
        end(outbox, now + 20, under_way(outbox))
    outbox.add(sample(2), 221.0)
    connect(outbox, 222.0)
    outbox.on_ack(take(outbox, 222.0, LiveSample), 222.0)
    notice = take(outbox, 240.0, LossNotice)
    assert notice.loss == Loss("a", "k", 1, 1, 1)
    outbox.on_ack(notice, 240.0)
    assert outbox.passes_over("device/a/history")
    assert outbox.due() == 220.0 + BANNED_FOR
    assert seqs(outbox.next(220.0 + BANNED_FOR)) == [2]


def test_a_denied_topic_loses_nothing_whatever_was_under_way_there() -> None:
    outbox = connected(now=-100.0)
    for seq in (1, 2):
        outbox.add(sample(seq), 0.0)
    take(outbox, 0.0, LiveSample)
    take(outbox, 10.0, HistoryBatch)
    for number, found in enumerate([None, "device/a/history"], 1):
        assert end(outbox, 10.0 * number, {"device/a/history": 100}, denied=True) == found
        connect(outbox, 10.0 * number + 1)
        outbox.next(10.0 * number + 11)
    assert (outbox.depth, outbox.stats.dropped) == (2, 0)
    outbox.lost(40.0)
    outbox.backlog.losses.restore(Loss("b", "k", 1, 1, 1))
    connect(outbox, 41.0)
    take(outbox, 60.0, LossNotice)
    outbox.suspects.ended({"event": 9}, certain=True)
    assert end(outbox, 61.0, {"event": 9}, denied=True) == "event"
    assert outbox.backlog.undeclared() == [Loss("b", "k", 1, 1, 1)]


def test_a_live_sample_that_ends_connections_goes_as_history() -> None:
    outbox = connected(now=-100.0)
    outbox.add(sample(1), 0.0)
    take(outbox, 0.0, LiveSample)
    end(outbox, 0.1, under_way(outbox))
    connect(outbox, 0.2)
    take(outbox, 0.3, LiveSample)
    assert end(outbox, 0.4, under_way(outbox)) == "device/a/telemetry"
    connect(outbox, 0.5)
    assert outbox.next(0.5) is None
    assert seqs(outbox.next(11.0)) == [1]


def test_a_message_that_ends_connections_is_dead_and_the_others_go_on() -> None:
    outbox = connected()
    outbox.add(named_event("first"), 0.0)
    found = []
    for _ in range(2):
        take(outbox, 0.0, Message)
        found.append(end(outbox, 1.0, {"event": 100}))
        connect(outbox, 2.0)
    assert found == [None, "event"]
    outbox.add(sample(1), 2.0)
    assert isinstance(outbox.next(2.0), LiveSample)
    assert outbox.next(2.0) is None


def test_where_several_were_under_way_each_goes_alone_and_the_rest_comes_through() -> None:
    outbox = Outbox()
    states = [state(1, "a"), state(1, "b"), state(1, "c")]
    outbox.connected(0.0)
    outbox.burst(states, ONLINE)
    for now in (1.0, 2.0):
        for _ in states:
            take(outbox, now, Retained)
        assert end(outbox, now, under_way(outbox)) is None
        outbox.connected(now)
        outbox.burst(states, ONLINE)
    first = take(outbox, 3.0, Retained)
    assert (outbox.next(3.0), outbox.waits, outbox.due()) == (None, True, None)
    outbox.on_ack(first, 3.0)
    outbox.suspects.acknowledged(first.topic, 100)
    second = take(outbox, 3.0, Retained)
    assert second.topic == "device/b/state"
    assert end(outbox, 3.0, {second.topic: 100}) == second.topic
    outbox.connected(4.0)
    outbox.burst(states, ONLINE)
    told = []
    while not outbox.announced:
        item = outbox.next(4.0)
        assert item is not None
        told.append(item.topic)
        outbox.on_ack(item, 4.0)
    assert told == ["device/a/state", "device/c/state", "availability"]


def test_what_goes_alone_waits_until_nothing_is_under_way() -> None:
    outbox = connected(now=-100.0)
    outbox.suspects.ended({"device/a/history": 100}, certain=True)
    outbox.add(sample(1), -10.0)
    outbox.add(sample(2), -10.0)
    outbox.add(sample(1, "b"), 0.0)
    live = take(outbox, 0.0, LiveSample)
    assert outbox.next(0.0) is None
    outbox.add(sample(2, "b"), 0.0)
    assert outbox.next(0.0) is None
    outbox.on_ack(live, 0.0)
    batch = take(outbox, 0.0, HistoryBatch)
    shorter = outbox.shorten(batch, 1)
    assert seqs(shorter) == [1]
    assert outbox.next(0.0) is None
    outbox.on_ack(shorter, 0.0)
    assert isinstance(outbox.next(0.0), LiveSample)


def test_a_batch_under_way_is_shortened_and_the_rest_goes_after_it() -> None:
    outbox = connected(now=-100.0)
    for seq in range(1, 6):
        outbox.add(sample(seq), 0.0)
    batch = take(outbox, 50.0, HistoryBatch)
    shorter = outbox.shorten(batch, 2)
    assert (seqs(shorter), tuple(outbox._in_flight), outbox.depth) == ([1, 2], (shorter,), 5)
    outbox.on_ack(shorter, 50.0)
    assert seqs(outbox.next(51.0)) == [3, 4, 5]


# What is too large


def test_a_batch_that_is_too_large_is_cut_until_it_fits() -> None:
    outbox = connected(now=-100.0)
    for seq in range(1, 6):
        outbox.add(sample(seq), 0.0)
    sizes, told = [], []
    for _ in range(3):
        batch = take(outbox, 50.0, HistoryBatch)
        sizes.append(len(batch.samples))
        told.append(outbox.unfit(batch))
    assert sizes == [5, 2, 1]
    assert told == [False, False, True]
    assert outbox.stats.dropped == 1
    take(outbox, 50.0, LossNotice)


def test_a_sample_that_is_too_large_is_declared_and_its_topic_reported_once() -> None:
    outbox = connected(now=-100.0)
    for seq in (1, 2, 3):
        outbox.add(sample(seq), 0.0)
    assert outbox.unfit(take(outbox, 0.0, LiveSample))
    assert not outbox.unfit(take(outbox, 0.0, LiveSample))
    assert seqs(outbox.next(0.0)) == [3]
    assert outbox.stats.dropped == 2
