"""The rules of the outbox, in virtual time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TypeVar

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from lfs10d.outbox.backlog import BATCH_MOST, HISTORY_AFTER, SAMPLE_EVERY, TURN_EVERY
from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.items import HistoryBatch, LiveSample, LossNotice, Message, OutboxItem, Retained, samples_of
from lfs10d.outbox.live_queue import LIVE_FOR
from lfs10d.outbox.losses import DECLARED_EVERY, Loss
from lfs10d.outbox.message_queue import MESSAGES_MOST
from lfs10d.outbox.outbox import Outbox
from lfs10d.outbox.refusals import BANNED_FOR
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry import publication as telemetry
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample
from tests.support.outbox_items import named_event

BATCH_EVERY = BATCH_MOST * SAMPLE_EVERY
NOT_AUTHORIZED = 0x87
QUOTA_EXCEEDED = 0x97
ONLINE = telemetry.retained("availability", "online")

AnyItem = TypeVar("AnyItem", bound=OutboxItem)


def sample(seq: int, device: str = "a") -> Publication:
    """Return a live sample; its ts is 1000 x seq."""
    measured = Sample(device, "k", seq, 1000 * seq, "synced", None, {}, (), "bad", "timeout", None)
    topic = telemetry.device_topic(device, telemetry.TELEMETRY)
    return Publication(topic, {}, PublicationKind.SAMPLE, retain=False, qos=1, sample=measured)


def state(version: int, device: str = "a") -> Publication:
    return telemetry.retained(telemetry.device_topic(device, "state"), {"version": version})


def trace(number: int) -> Publication:
    return Publication("trace", {"n": number}, PublicationKind.TRACE, retain=False, qos=0)


def seqs(item: OutboxItem | None) -> list[int]:
    assert item is not None
    return [queued.sample.seq for queued in samples_of(item)]


def take(outbox: Outbox, now: float, kind: type[AnyItem]) -> AnyItem:
    item = outbox.next(now)
    assert isinstance(item, kind)
    return item


def connect(outbox: Outbox, now: float, burst: Iterable[Publication] = (), *, window: int = 20) -> None:
    """Connect, and settle the burst."""
    outbox.connected(now, window=window)
    outbox.burst(burst, ONLINE)
    while not outbox.announced:
        item = outbox.next(now)
        assert item is not None
        outbox.on_ack(item, now)


def connected(now: float = 0.0, *, capacity: int = 10_000) -> Outbox:
    outbox = Outbox(capacity=capacity)
    connect(outbox, now)
    return outbox


# The order of things


def test_nothing_goes_while_the_broker_is_away() -> None:
    outbox = Outbox()
    outbox.add(sample(1), 0.0)
    assert outbox.next(0.0) is None
    assert outbox.due() is None


def test_after_a_connect_the_burst_goes_first_and_online_when_all_of_it_is_settled() -> None:
    outbox = Outbox()
    outbox.add(sample(1), 0.0)
    outbox.connected(0.0)
    outbox.burst([state(1, "a"), state(1, "b")], ONLINE)
    first, second = take(outbox, 0.0, Retained), take(outbox, 0.0, Retained)
    assert [first.topic, second.topic] == ["device/a/state", "device/b/state"]
    assert outbox.next(0.0) is None
    outbox.on_ack(second, 0.0)
    assert outbox.next(0.0) is None
    assert not outbox.announced
    outbox.on_ack(first, 0.0)
    online = take(outbox, 0.0, Retained)
    assert online.publication is ONLINE
    assert take(outbox, 0.0, LiveSample).queued.sample.seq == 1
    assert not outbox.announced
    outbox.on_ack(online, 0.0)
    assert outbox.announced


def test_what_is_retained_is_out_when_no_version_of_a_topic_waits() -> None:
    outbox = connected()
    out = [outbox.retained_out]
    outbox.add(state(1, "a"), 0.0)
    out.append(outbox.retained_out)
    take(outbox, 0.0, Retained)
    out.append(outbox.retained_out)
    outbox.lost(1.0)
    out.append(outbox.retained_out)
    assert out == [True, False, True, False]


def test_a_refused_part_of_the_burst_does_not_keep_online_back() -> None:
    outbox = Outbox()
    outbox.connected(0.0)
    outbox.burst([state(1)], ONLINE)
    assert outbox.refused(take(outbox, 0.0, Retained), NOT_AUTHORIZED, 0.0)
    assert take(outbox, 0.0, Retained).topic == "availability"


def test_a_flood_of_responses_delays_no_sample() -> None:
    outbox = connected()
    for number in range(4):
        outbox.add(named_event(f"e{number}"), 0.0)
    outbox.add(sample(1), 0.0)
    outbox.add(sample(2), 0.0)
    kinds = [type(outbox.next(0.0)) for _ in range(6)]
    assert kinds == [Message, LiveSample, Message, LiveSample, Message, Message]


def test_classes_go_in_order() -> None:
    outbox = connected()
    outbox.add(trace(1), 1.0)
    outbox.add(sample(1), 1.0)
    outbox.add(telemetry.event("device_added", 0), 1.0)
    outbox.add(state(1), 1.0)
    assert take(outbox, 1.0, Retained).topic == "device/a/state"
    assert take(outbox, 1.0, Message).topic == "event"
    assert take(outbox, 1.0, LiveSample).topic == "device/a/telemetry"
    assert take(outbox, 1.0, Message).topic == "trace"
    assert outbox.next(1.0) is None


def test_a_response_keeps_its_correlation() -> None:
    outbox = connected()
    response = Publication("response/health", {}, PublicationKind.RESPONSE, retain=False, qos=1)
    outbox.add(response, 0.0, correlation=b"\1")
    assert take(outbox, 0.0, Message).correlation == b"\1"


def test_no_more_than_the_window_is_under_way() -> None:
    outbox = Outbox()
    connect(outbox, 0.0, window=2)
    for seq in range(1, 4):
        outbox.add(sample(seq), 0.0)
    first = take(outbox, 0.0, LiveSample)
    take(outbox, 0.0, LiveSample)
    assert outbox.next(0.0) is None
    outbox.on_ack(first, 0.0)
    assert seqs(outbox.next(0.0)) == [3]
    assert [seqs(item) for item in outbox.under_way] == [[2], [3]]


# Retained topics


def test_of_a_retained_topic_the_newest_version_waits() -> None:
    outbox = connected()
    outbox.add(state(1), 0.0)
    outbox.add(state(2), 0.0)
    assert take(outbox, 0.0, Retained).publication.payload == {"version": 2}
    assert outbox.next(0.0) is None


def test_no_second_version_goes_while_the_first_is_under_way() -> None:
    outbox = connected()
    outbox.add(state(1), 0.0)
    first = take(outbox, 0.0, Retained)
    outbox.add(state(2), 0.0)
    assert outbox.next(0.0) is None
    outbox.on_ack(first, 0.0)
    assert take(outbox, 0.0, Retained).publication.payload == {"version": 2}


def test_a_second_burst_waits_for_the_first_to_be_over() -> None:
    outbox = connected()
    outbox.add(ONLINE, 0.0)
    online = take(outbox, 0.0, Retained)
    outbox.burst([], ONLINE)
    assert outbox.next(0.0) is None
    outbox.on_ack(online, 0.0)
    assert take(outbox, 0.0, Retained).topic == "availability"


def test_while_the_broker_is_away_only_clearing_of_retained_topics_is_kept() -> None:
    outbox = Outbox()
    outbox.add(state(1, "here"), 0.0)
    outbox.add(telemetry.retained("device/gone/state", None), 0.0)
    connect_letters = []
    outbox.connected(1.0)
    while (item := outbox.next(1.0)) is not None:
        connect_letters.append(item.topic)
    assert connect_letters == ["device/gone/state"]


def test_a_loss_keeps_clearings_and_forgets_the_other_versions() -> None:
    outbox = connected()
    outbox.add(telemetry.retained("device/gone/state", None), 0.0)
    outbox.add(state(1, "b"), 0.0)
    take(outbox, 0.0, Retained)
    take(outbox, 0.0, Retained)
    outbox.add(telemetry.retained("device/gone/config", None), 0.0)
    outbox.add(state(1, "c"), 0.0)
    outbox.lost(1.0)
    outbox.connected(2.0)
    topics = {take(outbox, 2.0, Retained).topic for _ in range(2)}
    assert topics == {"device/gone/state", "device/gone/config"}
    assert outbox.next(2.0) is None


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


# Loss of the connection


def test_what_is_under_way_when_the_connection_is_lost_waits_again_in_order() -> None:
    outbox = connected()
    for seq in range(1, 4):
        outbox.add(sample(seq), 0.0)
    take(outbox, 0.0, LiveSample)
    take(outbox, 0.0, LiveSample)
    outbox.lost(0.1)
    assert outbox.under_way == ()
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
    assert (outbox.depth, outbox.dropped) == (2, 1)


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
    assert outbox.dropped == 0


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
    assert outbox.under_way == (live,)
    assert outbox.depth == 1
    assert outbox.dropped == 1


# Refused and unfit


def test_a_refused_topic_is_reported_once_and_its_samples_wait_for_history_until_reload() -> None:
    outbox = connected(now=-100.0)
    for seq in (1, 2, 3):
        outbox.add(sample(seq), 0.0)
    first, second = take(outbox, 0.0, LiveSample), take(outbox, 0.0, LiveSample)
    assert outbox.refused(first, NOT_AUTHORIZED, 0.0)
    assert not outbox.refused(second, NOT_AUTHORIZED, 0.0)
    batch = take(outbox, 0.0, HistoryBatch)
    assert seqs(batch) == [1, 2, 3]
    assert outbox.dropped == 0
    assert outbox.refused(batch, NOT_AUTHORIZED, 0.0)
    assert outbox.next(1.0) is None
    assert outbox.depth == 3
    assert outbox.reload(1.0)
    assert not outbox.reload(1.0)
    outbox.add(sample(4), 1.0)
    assert seqs(outbox.next(1.0)) == [4]
    assert seqs(outbox.next(1.0)) == [1, 2, 3]


def test_a_refused_topic_does_not_stop_the_others() -> None:
    outbox = connected()
    outbox.add(state(1, "a"), 0.0)
    assert outbox.refused(take(outbox, 0.0, Retained), NOT_AUTHORIZED, 0.0)
    outbox.add(state(2, "a"), 0.0)
    outbox.add(state(1, "b"), 0.0)
    assert take(outbox, 0.0, Retained).topic == "device/b/state"


def test_refused_history_waits_and_the_other_devices_go_on() -> None:
    outbox = connected(now=-100.0)
    outbox.add(sample(1, "a"), 0.0)
    assert outbox.refused(take(outbox, 50.0, HistoryBatch), NOT_AUTHORIZED, 50.0)
    outbox.add(sample(2, "a"), 50.0)
    outbox.add(sample(1, "b"), 50.1)
    other = take(outbox, 60.0, HistoryBatch)
    assert other.topic == "device/b/history"
    outbox.on_ack(other, 60.0)
    assert (outbox.next(61.0), outbox.dropped, outbox.depth) == (None, 0, 2)


def test_where_all_history_is_refused_nothing_goes_and_nothing_is_due() -> None:
    outbox = connected(now=-100.0)
    outbox.add(sample(1), 0.0)
    assert outbox.refused(take(outbox, 50.0, HistoryBatch), NOT_AUTHORIZED, 50.0)
    outbox.add(sample(2), 50.0)
    assert outbox.next(60.0) is None
    assert (outbox.depth, outbox.due()) == (2, None)


def test_a_refused_availability_does_not_keep_the_rest_back() -> None:
    outbox = Outbox()
    outbox.connected(0.0)
    outbox.burst([], ONLINE)
    assert outbox.refused(take(outbox, 0.0, Retained), NOT_AUTHORIZED, 0.0)
    assert outbox.announced
    outbox.burst([], ONLINE)
    outbox.add(sample(1), 0.0)
    assert isinstance(outbox.next(0.0), LiveSample)
    assert outbox.announced


def test_a_refused_part_of_a_later_burst_is_left_out() -> None:
    outbox = connected()
    outbox.add(state(1), 0.0)
    assert outbox.refused(take(outbox, 0.0, Retained), NOT_AUTHORIZED, 0.0)
    outbox.burst([state(2)], ONLINE)
    assert take(outbox, 0.0, Retained).topic == "availability"


def test_a_refused_event_topic_keeps_losses_for_the_reload() -> None:
    outbox = Outbox(capacity=1)
    for seq in (1, 2):
        outbox.add(sample(seq), 0.0)
    connect(outbox, 10.0)
    assert outbox.refused(take(outbox, 20.0, LossNotice), NOT_AUTHORIZED, 20.0)
    assert outbox.due() == 20.0
    outbox.on_ack(take(outbox, 20.0, HistoryBatch), 20.0)
    assert outbox.next(200.0) is None
    assert outbox.reload(200.0)
    assert take(outbox, 200.0, LossNotice).loss.count == 1


def test_a_quota_is_asked_again_with_back_off_and_loses_nothing() -> None:
    outbox = connected(now=-100.0)
    outbox.add(sample(1), -10.0)
    now, told, tried = 0.0, [], []
    for _ in range(9):
        batch = take(outbox, now, HistoryBatch)
        tried.append(now)
        told.append(outbox.refused(batch, QUOTA_EXCEEDED, now))
        assert outbox.next(now + 0.9) is None
        due = outbox.due()
        assert due is not None
        now = due
    assert tried == [0, 1, 3, 7, 15, 31, 63, 123, 183]
    assert told == [True, *[False] * 8]
    outbox.on_ack(take(outbox, now, HistoryBatch), now)
    assert (outbox.depth, outbox.dropped) == (0, 0)


def test_a_live_sample_that_is_refused_goes_as_history_and_the_next_is_tried_live() -> None:
    outbox = connected(now=-100.0)
    outbox.add(sample(1), 0.0)
    assert outbox.refused(take(outbox, 0.0, LiveSample), QUOTA_EXCEEDED, 0.0)
    outbox.add(sample(2), 0.5)
    batch = take(outbox, 0.5, HistoryBatch)
    assert seqs(batch) == [1, 2]
    outbox.on_ack(batch, 0.5)
    outbox.add(sample(3), 1.0)
    assert take(outbox, 1.0, LiveSample).queued.sample.seq == 3


def test_an_event_that_is_refused_waits_and_delays_no_response() -> None:
    outbox = connected()
    outbox.add(named_event("first"), 0.0)
    event = take(outbox, 0.0, Message)
    outbox.add(named_event("second"), 0.0)
    outbox.add(Publication("response/x", {}, PublicationKind.RESPONSE, retain=False, qos=1), 0.0)
    assert outbox.refused(event, QUOTA_EXCEEDED, 0.0)
    assert take(outbox, 0.0, Message).topic == "response/x"
    assert outbox.next(0.9) is None
    kinds = [take(outbox, 1.0, Message).publication.payload for _ in range(2)]
    assert [isinstance(each, dict) and each["type"] for each in kinds] == ["first", "second"]


def test_a_refused_state_is_tried_again_in_its_newest_version_at_the_next_connect() -> None:
    outbox = connected()
    outbox.add(state(1), 0.0)
    assert outbox.refused(take(outbox, 0.0, Retained), NOT_AUTHORIZED, 0.0)
    outbox.add(state(2), 1.0)
    assert outbox.next(100.0) is None
    assert outbox.retained_out
    outbox.lost(101.0)
    connect(outbox, 102.0)
    outbox.add(state(3), 103.0)
    assert take(outbox, 103.0, Retained).publication == state(3)


def test_a_trace_that_is_refused_is_gone() -> None:
    outbox = connected()
    outbox.add(trace(1), 0.0)
    assert outbox.refused(take(outbox, 0.0, Message), NOT_AUTHORIZED, 0.0)
    outbox.add(trace(2), 0.0)
    assert outbox.next(0.0) is None
    assert outbox.reload(1.0)
    assert outbox.next(1.0) is None


def test_what_clears_topics_goes_when_nothing_else_does() -> None:
    outbox = connected(now=-100.0)
    for number in range(3):
        outbox.add(telemetry.retained(f"device/{number}/state", None), 0.0)
    outbox.add(sample(1), 0.0)
    outbox.add(state(1), 0.0)
    outbox.add(sample(1, "b"), -20.0)
    assert not outbox.idle
    kinds = [type(outbox.next(0.0)) for _ in range(6)]
    assert kinds == [Retained, LiveSample, HistoryBatch, Retained, Retained, Retained]


# What ends the connection


def under_way(outbox: Outbox) -> dict[str, int]:
    return {item.topic: 100 for item in outbox.under_way}


def end(outbox: Outbox, now: float, sent: dict[str, int], *, denied: bool = False) -> str | None:
    """End the connection by the broker's will and connect anew; return the topic found guilty."""
    culprit = outbox.suspects.ended(sent, certain=denied)
    outbox.lost(now, culprit, denied=denied)
    return None if culprit is None else culprit.topic


def test_a_batch_that_ends_two_connections_is_cut_over_connects_until_a_reload() -> None:
    outbox, found = Outbox(), []
    for seq in range(1, 5):
        outbox.add(sample(seq), 0.0)
    for now in (100.0, 200.0, 300.0):
        connect(outbox, now)
        batch = take(outbox, now + HISTORY_AFTER, HistoryBatch)
        found.append((len(batch.samples), end(outbox, now + 20, under_way(outbox))))
    assert found == [(4, None), (4, "device/a/history"), (2, "device/a/history")]
    assert outbox.dropped == 0
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
    assert (outbox.depth, outbox.dropped) == (2, 0)
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
    assert (seqs(shorter), outbox.under_way, outbox.depth) == ([1, 2], (shorter,), 5)
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
    assert outbox.dropped == 1
    take(outbox, 50.0, LossNotice)


def test_a_sample_that_is_too_large_is_declared_and_its_topic_reported_once() -> None:
    outbox = connected(now=-100.0)
    for seq in (1, 2, 3):
        outbox.add(sample(seq), 0.0)
    assert outbox.unfit(take(outbox, 0.0, LiveSample))
    assert not outbox.unfit(take(outbox, 0.0, LiveSample))
    assert seqs(outbox.next(0.0)) == [3]
    assert outbox.dropped == 2


# What waits


def test_idle_is_when_nothing_but_the_backlog_waits() -> None:
    outbox = connected()
    idle = [outbox.idle]
    outbox.add(sample(1), 0.0)
    idle.append(outbox.idle)
    live = take(outbox, 0.0, LiveSample)
    idle.append(outbox.idle)
    outbox.on_ack(live, 0.0)
    idle.append(outbox.idle)
    assert idle == [True, False, False, True]


def test_the_oldest_that_waits_is_told_wherever_it_waits() -> None:
    outbox = connected(now=-100.0)
    assert outbox.stats == telemetry.BacklogStats()
    outbox.add(sample(7), 0.0)
    outbox.add(sample(8), 5.0)
    assert outbox.stats == telemetry.BacklogStats(depth=2, oldest_ts=7000, dropped=0)
    take(outbox, 5.0, LiveSample)
    take(outbox, 5.0, HistoryBatch)
    assert outbox.stats == telemetry.BacklogStats(depth=2, oldest_ts=7000, dropped=0)


def test_what_the_store_could_not_take_waits_in_memory_as_far_as_there_is_room() -> None:
    outbox = Outbox(capacity=3)
    for seq in (1, 2):
        outbox.add(sample(seq), 0.0)
    outbox.age(4.0)
    outbox.backlog.spill.take()
    outbox.backlog.history.add(QueuedSample(sample_of(3), 4.0))
    outbox.backlog.history.add(QueuedSample(sample_of(4), 4.0))
    outbox.not_spilled(4.0)
    assert (outbox.depth, outbox.dropped) == (3, 1)


def sample_of(seq: int) -> Sample:
    measured = sample(seq).sample
    assert measured is not None
    return measured


def test_what_lies_in_the_store_counts_and_is_the_oldest() -> None:
    outbox = Outbox()
    outbox.backlog.spool.update(5, 77)
    outbox.add(sample(6), 0.0)
    assert outbox.stats == telemetry.BacklogStats(depth=6, oldest_ts=77, dropped=0)


def test_when_the_oldest_live_sample_grows_old_is_known() -> None:
    outbox = Outbox()
    assert outbox.next_old() is None
    outbox.add(sample(1), 5.0)
    outbox.add(sample(2), 6.0)
    assert outbox.next_old() == 5.0 + LIVE_FOR


def test_a_clock_set_right_corrects_live_samples_and_their_payloads() -> None:
    outbox = connected()
    clocks: tuple[ClockState, ...] = ("unsynced", "synced")
    for seq, clock in enumerate(clocks, 1):
        publication = sample(seq)
        assert publication.sample is not None
        measured = replace(publication.sample, clock=clock)
        payload = measured.payload("line0")
        outbox.add(replace(publication, sample=measured, payload=payload), 0.0, shift=500)
    outbox.correct(7500)
    told = [take(outbox, 0.0, LiveSample).publication for _ in range(2)]
    assert [(each.sample and each.sample.ts, each.sample and each.sample.clock) for each in told] == [
        (8000, "synced"),
        (2000, "synced"),
    ]
    payloads = [each.payload for each in told if isinstance(each.payload, dict)]
    assert [(each["ts"], each["time"], each["clock"], each["line"]) for each in payloads] == [
        (8000, "1970-01-01T00:00:08.000Z", "synced", "line0"),
        (2000, "1970-01-01T00:00:02.000Z", "synced", "line0"),
    ]


# Laws


class OutboxLaws(RuleBasedStateMachine):
    """Whatever happens: nothing is lost undeclared, order holds, bounds hold."""

    CAPACITY = 30
    WINDOW = 5

    def __init__(self) -> None:
        super().__init__()
        self.outbox = Outbox(capacity=self.CAPACITY)
        self.now = 0.0
        self.online = False
        self.seqs = {"a": 0, "b": 0}
        self.delivered: set[tuple[str, int]] = set()
        self.declared: list[Loss] = []
        self.last_live = {"a": 0, "b": 0}

    @rule(device=st.sampled_from("ab"), count=st.integers(1, 15))
    def measure(self, device: str, count: int) -> None:
        for _ in range(count):
            self.seqs[device] += 1
            self.outbox.add(sample(self.seqs[device], device), self.now)

    @rule(seconds=st.sampled_from([0.01, 0.2, 2.0, 4.0, 11.0, 70.0]))
    def wait(self, seconds: float) -> None:
        self.now += seconds

    @precondition(lambda self: not self.online)
    @rule()
    def connect(self) -> None:
        connect(self.outbox, self.now, window=self.WINDOW)
        self.online = True

    @precondition(lambda self: self.online)
    @rule()
    def lose(self) -> None:
        self.outbox.lost(self.now)
        self.online = False

    @precondition(lambda self: self.online)
    @rule(denied=st.booleans())
    def throw_out(self, denied: bool) -> None:  # noqa: FBT001 - drawn by hypothesis
        """End the connection for what is under way, as the broker does."""
        end(self.outbox, self.now, under_way(self.outbox), denied=denied)
        self.online = False

    @rule()
    def take(self) -> None:
        item = self.outbox.next(self.now)
        if item is None:
            return
        assert self.online
        queued = samples_of(item)
        assert [each.sample.seq for each in queued] == sorted({each.sample.seq for each in queued})
        assert len({each.key for each in queued}) <= 1
        if isinstance(item, LiveSample):
            assert self.now - item.queued.since <= LIVE_FOR
        if isinstance(item, HistoryBatch):
            assert len(queued) <= BATCH_MOST

    @precondition(lambda self: self.outbox.under_way)
    @rule(
        which=st.integers(0, 4), fate=st.sampled_from(["settled", "settled", "settled", "refused", "denied", "unfit"])
    )
    def answer(self, which: int, fate: str) -> None:
        item = self.outbox.under_way[which % len(self.outbox.under_way)]
        if fate == "settled":
            self.outbox.on_ack(item, self.now)
            self.delivered |= {(each.sample.device, each.sample.seq) for each in samples_of(item)}
            if isinstance(item, LossNotice):
                self.declared.append(item.loss)
        elif fate == "refused":
            self.outbox.refused(item, QUOTA_EXCEEDED, self.now)
        elif fate == "denied":
            self.outbox.refused(item, NOT_AUTHORIZED, self.now)
        else:
            self.outbox.unfit(item)

    @invariant()
    def bounds_hold(self) -> None:
        assert self.outbox.depth <= self.CAPACITY
        assert len(self.outbox.under_way) <= self.WINDOW
        # Arrays may be several (contract, section 3: one at least every 2 s, however long the round trip is).
        assert sum(isinstance(each, LossNotice) for each in self.outbox.under_way) <= 1

    def teardown(self) -> None:
        """Drain: then every sample was delivered or declared, and the declared count is right."""
        if not self.online:
            connect(self.outbox, self.now, window=self.WINDOW)
        for item in self.outbox.under_way:
            self.outbox.on_ack(item, self.now)
            self.delivered |= {(each.sample.device, each.sample.seq) for each in samples_of(item)}
            if isinstance(item, LossNotice):
                self.declared.append(item.loss)
        self.outbox.reload(self.now)
        self.now += HISTORY_AFTER + DECLARED_EVERY
        for _ in range(1000):
            taken = self.outbox.next(self.now)
            if taken is not None:
                self.outbox.on_ack(taken, self.now)
                self.delivered |= {(each.sample.device, each.sample.seq) for each in samples_of(taken)}
                if isinstance(taken, LossNotice):
                    self.declared.append(taken.loss)
                continue
            due = self.outbox.due()
            if due is None:
                break
            self.now = max(self.now, due)
        assert self.outbox.depth == 0
        covered = {(loss.source, seq) for loss in self.declared for seq in range(loss.from_seq, loss.to_seq + 1)}
        measured = {(device, seq) for device, last in self.seqs.items() for seq in range(1, last + 1)}
        assert self.delivered | covered == measured
        assert sum(loss.count for loss in self.declared) == self.outbox.dropped


OutboxLaws.TestCase.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)


TestOutboxLaws = OutboxLaws.TestCase


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


def test_it_says_whether_anything_waits() -> None:
    outbox = Outbox()
    told = [outbox.waits]
    outbox.connected(0.0)
    outbox.burst([], ONLINE)
    told.append(outbox.waits)
    item = outbox.next(0.0)
    assert item is not None
    told.append(outbox.waits)
    outbox.on_ack(item, 0.0)
    outbox.add(Publication("event", {}, PublicationKind.EVENT, retain=False, qos=1), 0.0)
    told.append(outbox.waits)
    assert told == [False, True, False, True]


def refresh(version: int) -> Publication:
    return telemetry.retained("device/a/state", {"version": version}, refresh=True)


def test_what_the_window_carries_is_told_once_where_states_are_replaced_before_they_go() -> None:
    outbox = Outbox()
    connect(outbox, 0.0, window=1)
    told = []
    for second in range(60):
        outbox.add(sample(second + 1), float(second))
        outbox.add(refresh(second), float(second))
        item = outbox.next(float(second))
        assert item is not None
        outbox.add(refresh(second), float(second))
        outbox.on_ack(item, second + 0.9)
        told.append(outbox.congested(second + 0.9))
    (congested,) = [each for each in told if each is not None]
    assert congested.window == 1
    assert congested.round_trip == pytest.approx(0.9)


def test_once_the_window_was_full_refreshes_have_their_turn_until_nothing_waits() -> None:
    outbox = Outbox()
    connect(outbox, 0.0, window=1)
    for seq in range(1, 13):
        outbox.add(sample(seq), 0.0)
    outbox.add(refresh(1), 0.0)
    kinds = []
    for _ in range(13):
        item = outbox.next(0.0)
        assert item is not None
        kinds.append(type(item))
        assert outbox.next(0.0) is None
        outbox.on_ack(item, 0.0)
    assert kinds.index(Retained) < 4
    assert outbox.next(0.0) is None
    outbox.add(refresh(2), 1.0)
    outbox.add(sample(13), 1.0)
    assert isinstance(outbox.next(1.0), LiveSample)


def test_no_batch_is_taken_while_the_one_before_is_not_on_its_way() -> None:
    outbox = Outbox()
    outbox.add(sample(1), 0.0)
    connect(outbox, 50.0)
    assert outbox.next(60.0, batch=False) is None
    assert isinstance(outbox.next(60.0), HistoryBatch)


def test_a_burst_that_lasts_takes_turns_with_the_rest_after_ten_seconds() -> None:
    outbox = Outbox()
    outbox.connected(0.0, window=1)
    outbox.burst([state(1, "a"), state(1, "b"), state(1, "c"), state(1, "d")], ONLINE)
    kinds = []
    for now in (0.0, 5.0, 9.9, 10.0, 10.1, 10.2):
        if now > 9.0:
            outbox.add(sample(int(10 * now)), now)
        item = outbox.next(now)
        assert item is not None
        assert outbox.next(now) is None
        kinds.append(type(item))
        outbox.on_ack(item, now)
    assert kinds[:3] == [Retained] * 3
    assert LiveSample in kinds[3:]
    assert Retained in kinds[3:]


def test_without_telemetry_samples_are_not_taken_and_the_backlog_stays_where_it_is() -> None:
    outbox = Outbox()
    outbox.add(sample(1), 0.0)
    connect(outbox, 50.0)
    outbox.telemetry = False
    outbox.add(sample(2), 55.0)
    assert outbox.next(60.0) is None
    assert outbox.due() is None
    assert not outbox.waits
    outbox.add(state(1), 61.0)
    assert take(outbox, 61.0, Retained).topic == "device/a/state"
    outbox.telemetry = True
    assert seqs(take(outbox, 62.0, HistoryBatch)) == [1]


def test_what_carries_no_sample_counts_for_nothing_in_the_depth() -> None:
    outbox = connected()
    outbox.add(state(1), 0.0)
    outbox.add(sample(1), 0.0)
    take(outbox, 0.0, Retained)
    take(outbox, 0.0, LiveSample)
    assert outbox.depth == 1


# The last message


OFFLINE = telemetry.retained("availability", "offline")


def test_the_last_message_goes_when_there_is_room_and_nothing_goes_after_it() -> None:
    outbox = Outbox()
    connect(outbox, 0.0, window=1)
    for seq in (1, 2):
        outbox.add(sample(seq), 0.0)
    first = outbox.next(0.0)
    assert first is not None
    parting = outbox.part(OFFLINE)
    assert outbox.next(0.0) is None
    assert outbox.waits
    outbox.on_ack(first, 0.1)
    last = outbox.next(0.1)
    assert last is parting.last
    assert (outbox.due(), parting.over) == (None, False)
    outbox.on_ack(parting.last, 0.2)
    assert (outbox.next(0.2), outbox.waits, parting.over) == (None, False, True)
    assert outbox.depth == 1, "the other sample is kept"


def test_a_last_message_that_is_refused_does_not_go_over_the_next_connection() -> None:
    outbox = connected()
    parting = outbox.part(OFFLINE)
    assert outbox.next(0.0) is parting.last
    assert outbox.refused(parting.last, NOT_AUTHORIZED, 0.0)
    assert parting.over
    outbox.lost(0.1)
    connect(outbox, 1.0)
    assert outbox.next(1.0) is None
