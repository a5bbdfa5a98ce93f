"""Samples whose acknowledgement may mean nothing are sent once more."""

from __future__ import annotations

from collections.abc import Iterable

from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.recent_acks import AGAIN_WITHIN, RecentAcks
from tests.support.outbox_items import queued

DETECTION = 40.0


def recent() -> RecentAcks:
    return RecentAcks(capacity=10, detection=DETECTION)


def seqs(samples: Iterable[QueuedSample]) -> list[int]:
    taken = list(samples)
    assert all(each.repeated for each in taken)
    return [each.sample.seq for each in taken]


def acknowledge(acks: RecentAcks, seq: int, now: float, *, without_listener: bool = False) -> None:
    acks.add((queued("a", seq),), now, without_listener=without_listener)


def test_without_a_loss_nothing_is_sent_again() -> None:
    acks = recent()
    acknowledge(acks, 1, 0.0)
    assert (acks.waiting, acks.repeat) == (False, False)
    assert seqs(acks.take_lost()) == []


def test_after_a_loss_the_last_ten_seconds_go_again_from_when_it_may_have_happened() -> None:
    acks = recent()
    acknowledge(acks, 1, 0.0)
    acknowledge(acks, 2, 5.0)
    acknowledge(acks, 3, 14.0)  # 1 is forgotten: a loss now would not touch it
    acks.lost(20.0 + DETECTION)
    acks.lost(99.0 + DETECTION)  # while it is away nothing is forgotten
    acknowledge(acks, 4, 200.0)
    assert (acks.waiting, acks.repeat) == (True, True)
    assert seqs(acks.again()) == [3, 4]
    assert (acks.waiting, acks.repeat) == (False, False)


def test_what_nobody_listened_to_goes_again_without_a_loss() -> None:
    acks = recent()
    acknowledge(acks, 1, 0.0, without_listener=True)
    acknowledge(acks, 2, 1.0)
    assert (acks.waiting, acks.repeat) == (True, False)
    assert seqs(acks.again()) == [1]


def test_what_nobody_listened_to_goes_again_with_the_rest_after_a_loss() -> None:
    acks = recent()
    acknowledge(acks, 1, 0.0, without_listener=True)
    acks.lost(1.0)
    acknowledge(acks, 2, 2.0, without_listener=True)
    assert seqs(acks.take_lost()) == [1, 2]


def test_a_broker_that_was_left_in_order_has_everything() -> None:
    acks = recent()
    acknowledge(acks, 1, 0.0)
    acknowledge(acks, 2, 0.0, without_listener=True)
    acks.on_clean_exit()
    acks.lost(1.0)
    assert not acks.waiting


def test_one_that_was_left_before_the_samples_went_again_has_not() -> None:
    acks = recent()
    acknowledge(acks, 1, 0.0)
    acks.lost(AGAIN_WITHIN)
    acks.on_clean_exit()
    assert acks.waiting
