"""What is lost is declared exactly: ranges per device and boot, neither more nor less."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from lfs10d.outbox.losses import DECLARED_EVERY, MOST_RANGES, Loss, Losses
from lfs10d.telemetry.publication import Sample


def sample(seq: int, device: str = "a") -> Sample:
    return Sample(device, "k", seq, 0, "synced", None, {}, (), "bad", "timeout", None)


def all_of(losses: Losses) -> list[Loss]:
    taken = []
    while (loss := losses.take(0.0)) is not None:
        taken.append(loss)
    return taken


def test_neighbours_are_one_range() -> None:
    losses = Losses()
    for seq in (4, 5, 7, 6):
        losses.add(sample(seq))
    assert losses.total == 4
    assert losses.take(0.0) == Loss("a", "k", 4, 7, 4)


def test_what_lies_between_two_ranges_is_not_declared() -> None:
    losses = Losses()
    for seq in (1, 3):
        losses.add(sample(seq))
    assert all_of(losses) == [Loss("a", "k", 1, 1, 1), Loss("a", "k", 3, 3, 1)]


def test_devices_are_declared_apart() -> None:
    losses = Losses()
    losses.add(sample(1, "a"))
    losses.add(sample(2, "b"))
    assert {loss.source for loss in all_of(losses)} == {"a", "b"}


def test_it_says_whether_a_loss_waits() -> None:
    losses = Losses()
    assert not losses.waiting
    losses.restore(Loss("a", "k", 1, 2, 2))
    assert losses.waiting


def test_nothing_lost_is_nothing_declared() -> None:
    losses = Losses()
    assert losses.take(0.0) is None
    assert losses.due() is None


def test_a_lasting_cause_is_declared_once_a_minute() -> None:
    losses = Losses()
    losses.add(sample(1))
    assert losses.due() == float("-inf")
    assert losses.take(100.0) is not None
    losses.add(sample(2))
    assert losses.due() == 100.0 + DECLARED_EVERY
    assert losses.take(100.0) is None
    assert losses.take(100.0 + DECLARED_EVERY) == Loss("a", "k", 2, 2, 1)


def test_a_new_connection_declares_at_once() -> None:
    losses = Losses()
    losses.add(sample(1))
    losses.take(100.0)
    losses.add(sample(2))
    losses.connected()
    assert losses.take(100.0) == Loss("a", "k", 2, 2, 1)


def test_what_was_not_acknowledged_is_declared_again() -> None:
    losses = Losses()
    losses.add(sample(1))
    loss = losses.take(0.0)
    assert loss is not None
    losses.restore(loss)
    losses.connected()
    assert losses.take(0.0) == loss
    assert losses.total == 1


def test_scattered_losses_take_bounded_room_and_keep_their_count() -> None:
    losses = Losses()
    for seq in range(1, 100, 2):
        losses.add(sample(seq))
    taken = all_of(losses)
    assert len(taken) == MOST_RANGES
    assert sum(loss.count for loss in taken) == 50
    assert taken[-1].to_seq == 99


@given(st.sets(st.integers(1, 30)))
def test_the_ranges_cover_everything_lost_once(seqs: set[int]) -> None:
    losses = Losses()
    for seq in sorted(seqs, key=lambda each: each * 7 % 31):
        losses.add(sample(seq))
    taken = all_of(losses)
    assert sum(loss.count for loss in taken) == len(seqs) == losses.total
    covered = [seq for loss in taken for seq in range(loss.from_seq, loss.to_seq + 1)]
    assert seqs <= set(covered)
    assert len(covered) == len(set(covered))
    if len(seqs) <= MOST_RANGES:
        assert set(covered) == seqs


def test_what_the_store_had_no_room_for_counts_and_waits_to_be_declared() -> None:
    losses = Losses()
    losses.evicted([Loss("a", "k", 1, 5, 5), Loss("b", "k", 2, 2, 1), Loss("a", "k", 6, 6, 1)])
    assert losses.total == 7
    assert losses.undeclared() == [Loss("a", "k", 1, 6, 6), Loss("b", "k", 2, 2, 1)]
