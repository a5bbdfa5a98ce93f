"""What the broker refuses: topics, quotas, samples, the burst."""

from __future__ import annotations

from lfs10d.outbox.items import HistoryBatch, LiveSample, LossNotice, Message, Retained
from lfs10d.outbox.outbox import Outbox
from lfs10d.telemetry import publication as telemetry
from lfs10d.telemetry.publication import Publication, PublicationKind
from tests.support.outbox_items import named_event
from tests.support.outboxes import (
    NOT_AUTHORIZED,
    ONLINE,
    QUOTA_EXCEEDED,
    connect,
    connected,
    sample,
    seqs,
    state,
    take,
    trace,
)

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
    assert outbox.stats.dropped == 0
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
    assert (outbox.next(61.0), outbox.stats.dropped, outbox.depth) == (None, 0, 2)


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
    assert (outbox.depth, outbox.stats.dropped) == (0, 0)


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
