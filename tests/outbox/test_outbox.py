"""The rules of the outbox, in virtual time."""

from __future__ import annotations

from dataclasses import replace

from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.items import HistoryBatch, LiveSample, Message, Retained
from lfs10d.outbox.live_queue import LIVE_FOR
from lfs10d.outbox.outbox import Outbox
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry import publication as telemetry
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample
from tests.support.outbox_items import named_event
from tests.support.outboxes import (
    NOT_AUTHORIZED,
    ONLINE,
    connect,
    connected,
    sample,
    seqs,
    state,
    take,
    trace,
)

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
    assert [seqs(item) for item in outbox._in_flight] == [[2], [3]]


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
    assert (outbox.depth, outbox.stats.dropped) == (3, 1)


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


def test_what_carries_no_sample_counts_for_nothing_in_the_depth() -> None:
    outbox = connected()
    outbox.add(state(1), 0.0)
    outbox.add(sample(1), 0.0)
    take(outbox, 0.0, Retained)
    take(outbox, 0.0, LiveSample)
    assert outbox.depth == 1
