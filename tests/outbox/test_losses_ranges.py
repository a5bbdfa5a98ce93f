"""Losses of one key are joined without inventing or forgetting any."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from lfs10d.outbox.losses import Loss, joined


def one(seq: int) -> Loss:
    return Loss("a", "k", seq, seq, 1)


def test_neighbours_become_one_and_gaps_stay() -> None:
    assert joined([one(3), one(1), one(2), one(5)], 8) == [Loss("a", "k", 1, 3, 3), one(5)]


def test_beyond_the_most_the_last_become_one_whose_count_is_below_its_span() -> None:
    assert joined([one(1), one(3), one(5), one(9)], 2) == [one(1), Loss("a", "k", 3, 9, 3)]


def test_a_loss_knows_its_key() -> None:
    assert one(1).key == ("a", "k")


@given(st.sets(st.integers(1, 60)), st.integers(1, 10))
def test_everything_lost_is_covered_and_counted_once(seqs: set[int], most: int) -> None:
    losses = joined([one(seq) for seq in seqs], most)
    assert len(losses) <= most
    assert sum(loss.count for loss in losses) == len(seqs)
    covered = [seq for loss in losses for seq in range(loss.from_seq, loss.to_seq + 1)]
    assert seqs <= set(covered)
    assert len(covered) == len(set(covered))
