"""When samples go to the store."""

from __future__ import annotations

from dataclasses import replace

from lfs10d.outbox.history import History
from lfs10d.outbox.recent_acks import RecentAcks
from lfs10d.outbox.spill import AWAY_AFTER, SPILL_EVERY, SPILL_MOST, Spill
from tests.support.outbox_items import queued

CAPACITY = 10_000


class Memory:
    """A history of `count` samples and its spill; the broker is there."""

    def __init__(self, count: int = 1) -> None:
        self.history = History()
        self.history.extend(queued("a", seq) for seq in range(1, count + 1))
        self.recent = RecentAcks(capacity=CAPACITY, detection=40.0)
        self.spill = Spill(self.history, self.recent, CAPACITY)
        self.spill.away = False


def test_at_the_start_what_waits_goes_at_once() -> None:
    memory = Memory()
    memory.spill.away = True
    due = memory.spill.due()
    assert due is not None
    assert due <= 0.0


def test_while_the_broker_is_there_nothing_goes_until_half_of_the_memory_is_taken() -> None:
    assert Memory(CAPACITY // 2).spill.due() is None
    assert Memory(CAPACITY // 2 + 1).spill.due() is not None


def test_three_seconds_after_a_loss_the_first_commit_is_due_and_then_every_five() -> None:
    memory = Memory()
    memory.spill.lost(100.0)
    memory.spill.lost(101.0)  # another attempt that failed
    assert memory.spill.due() == 100.0 + AWAY_AFTER
    assert len(memory.spill.take()) == 1
    assert memory.spill.due() is None, "one at a time"
    memory.spill.done(103.0)
    assert memory.spill.due() is None, "nothing waits"
    memory.history.add(queued("a", 2))
    assert memory.spill.due() == 103.0 + SPILL_EVERY


def test_what_does_not_fit_into_one_commit_goes_in_the_next_at_once() -> None:
    memory = Memory(SPILL_MOST + 1)
    memory.spill.lost(0.0)
    assert len(memory.spill.take()) == SPILL_MOST
    memory.spill.done(50.0)
    assert memory.spill.due() == AWAY_AFTER


def test_what_was_acknowledged_just_before_a_loss_goes_too() -> None:
    memory = Memory(0)
    memory.recent.add((queued("a", 1),), 0.0, without_listener=False)
    before = memory.spill.at_last
    memory.recent.lost(1.0)
    memory.spill.lost(1.0)
    assert (before, memory.spill.at_last) == (False, True)
    assert [each.repeated for each in memory.spill.take()] == [True]


def test_while_the_broker_is_there_what_it_acknowledged_stays() -> None:
    memory = Memory(0)
    memory.recent.add((queued("a", 1),), 0.0, without_listener=False)
    memory.recent.lost(1.0)
    assert memory.spill.take() == []


def test_what_the_store_cannot_take_waits_for_five_seconds() -> None:
    memory = Memory()
    memory.spill.lost(0.0)
    memory.spill.take()
    memory.spill.failed(9.0)
    assert (len(memory.history), memory.spill.samples, memory.spill.due()) == (1, [], 9.0 + SPILL_EVERY)


def test_what_is_being_handed_over_is_corrected() -> None:
    memory = Memory(0)
    unsynced = queued("a", 1)
    memory.history.add(replace(unsynced, sample=replace(unsynced.sample, clock="unsynced"), shift=0))
    memory.spill.take()
    memory.spill.correct(5000, "synced")
    assert [(each.sample.ts, each.sample.clock) for each in memory.spill.samples] == [(6000, "synced")]
