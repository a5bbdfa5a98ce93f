"""Live samples wait in turn."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.items import LiveSample
from lfs10d.outbox.live_queue import LIVE_FOR, LiveQueue
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample


def live(device: str, seq: int, since: float = 0.0) -> LiveSample:
    measured = Sample(device, "k", seq, 1000 * seq, "synced", None, {}, (), "bad", "timeout", None)
    return LiveSample(
        Publication(f"device/{device}/telemetry", {}, PublicationKind.SAMPLE, retain=False, qos=1, sample=measured),
        QueuedSample(measured, since),
    )


def told(item: LiveSample | None) -> tuple[str, int] | None:
    return None if item is None else (item.queued.sample.device, item.queued.sample.seq)


def everything(queue: LiveQueue) -> list[tuple[str, int] | None]:
    return [told(queue.take()) for _ in range(len(queue))]


def test_where_none_waits_there_is_none() -> None:
    queue = LiveQueue()
    assert (queue.take(), queue.take_oldest(), queue.oldest(), len(queue)) == (None, None, None, 0)


def test_devices_go_in_turn() -> None:
    queue = LiveQueue()
    for device, seq in (("a", 1), ("a", 2), ("a", 3), ("b", 1), ("c", 1)):
        queue.add(live(device, seq))
    assert everything(queue) == [("a", 1), ("b", 1), ("c", 1), ("a", 2), ("a", 3)]


def test_what_is_put_back_goes_before_the_others_of_its_device() -> None:
    queue = LiveQueue()
    for seq in (1, 2, 3):
        queue.add(live("a", seq))
    first, second = queue.take(), queue.take()
    assert first is not None
    assert second is not None
    queue.put_back(second)
    queue.put_back(first)
    assert queue.oldest() is first
    assert everything(queue) == [("a", 1), ("a", 2), ("a", 3)]


def test_the_oldest_may_be_taken_out_of_its_turn() -> None:
    queue = LiveQueue()
    for device, seq in (("a", 1), ("b", 1), ("b", 2)):
        queue.add(live(device, seq))
    assert [told(queue.take_oldest()) for _ in range(2)] == [("a", 1), ("b", 1)]
    assert everything(queue) == [("b", 2)]


def test_what_is_corrected_keeps_its_turn() -> None:
    queue = LiveQueue()
    for device, seq in (("a", 1), ("a", 2), ("b", 1)):
        item = live(device, seq, 1.0)
        unsynced = replace(item.queued.sample, clock="unsynced")
        queue.add(replace(item, queued=replace(item.queued, sample=unsynced, shift=0)))
    queue.correct(60_000)
    oldest = queue.oldest()
    assert oldest is not None
    assert (oldest.queued.sample.ts, oldest.queued.sample.clock) == (61_000, "synced")
    assert everything(queue) == [("a", 1), ("b", 1), ("a", 2)]


def test_samples_are_old_after_three_seconds() -> None:
    queue = LiveQueue()
    assert [queue.old_at] == [None]
    queue.add(live("a", 1, 1.0))
    queue.add(live("a", 2, 2.0))
    assert list(queue.take_old(4.0)) == []
    assert [told(each) for each in queue.take_old(4.1)] == [("a", 1)]
    oldest = queue.old_at
    assert oldest == 2.0 + LIVE_FOR
    assert [told(each) for each in queue.take_old(9.0)] == [("a", 2)]
    assert not queue.waiting


@given(st.lists(st.one_of(st.sampled_from("abc"), st.none(), st.just(""))))
def test_nothing_is_lost_and_each_device_stays_in_order(steps: list[str | None]) -> None:
    queue, seqs = LiveQueue(), dict.fromkeys("abc", 0)
    gone: list[tuple[str, int] | None] = []
    for step in steps:
        if step:
            seqs[step] += 1
            queue.add(live(step, seqs[step], len(gone) + sum(seqs.values())))
        else:
            gone.append(told(queue.take() if step is None else queue.take_oldest()))
    gone += everything(queue)
    assert len(queue) == 0
    for device, last in seqs.items():
        assert [each[1] for each in gone if each and each[0] == device] == list(range(1, last + 1))
