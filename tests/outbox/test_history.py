"""What waits for history is kept in order, per device and boot."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from lfs10d.outbox.history import History, QueuedSample
from lfs10d.telemetry.publication import Sample
from tests.support.outbox_items import record


def queued(device: str, seq: int, since: float | None = None, *, repeated: bool = False) -> QueuedSample:
    sample = Sample(device, "k", seq, 0, "synced", None, {}, (), "bad", "timeout", None)
    return QueuedSample(sample, float(seq) if since is None else since, repeated)


def seqs(taken: tuple[QueuedSample, ...]) -> list[tuple[str, int]]:
    return [(each.sample.device, each.sample.seq) for each in taken]


def test_nothing_waits_at_first() -> None:
    history = History()
    assert (len(history), history.take(100), history.oldest(), history.evict()) == (0, (), None, None)


def test_the_device_with_the_oldest_sample_is_taken_first() -> None:
    history = History()
    history.extend([queued("a", 1, 5.0), queued("b", 1, 4.0), queued("b", 2, 6.0)])
    assert history.oldest() == queued("b", 1, 4.0)
    assert [seqs(history.take(100)) for _ in range(2)] == [[("b", 1), ("b", 2)], [("a", 1)]]


def test_what_came_at_once_from_the_store_goes_by_its_rows_though_a_part_was_put_back() -> None:
    """A batch that is cut to 8000 bytes must not let a later boot go before the rest of it."""
    history = History()
    older = [replace(queued("a", seq, 0.0), row=seq) for seq in (1, 2, 3)]
    newer = replace(queued("a", 1, 0.0), row=4)
    newer = replace(newer, sample=replace(newer.sample, boot="l"))
    history.extend([*older, newer])
    taken = history.take(100)
    assert taken == tuple(older)
    history.put_back(taken[1:])
    assert history.oldest() == older[1]
    assert [history.take(100), history.take(100)] == [tuple(older[1:]), (newer,)]


def test_devices_that_are_passed_over_stay() -> None:
    history = History()
    history.extend([queued("a", 1), queued("b", 2), queued("b", 3)])
    assert [history.waits(), history.waits({"a"}), history.waits({"a", "b"})] == [True, True, False]
    assert seqs(history.take(100, {"a"})) == [("b", 2), ("b", 3)]
    assert history.take(100, {"a"}) == ()
    assert len(history) == 1


@given(st.integers(1, 8), st.integers(0, 8), st.sets(st.integers(1, 12), max_size=12))
def test_what_was_taken_is_put_back_in_its_place(most: int, kept_of_it: int, seqs_there: set[int]) -> None:
    history = History()
    history.extend(queued("a", seq, repeated=seq % 2 == 0) for seq in seqs_there)
    taken = history.take(most)
    history.add(queued("a", 3, repeated=False) if 3 not in seqs_there else queued("a", 13))
    back = taken[kept_of_it:]
    if back:
        history.put_back(back)
    rest = history.take(100)
    numbers = [each.sample.seq for each in rest]
    assert numbers == sorted(numbers)
    assert sorted([*(each.sample.seq for each in taken[:kept_of_it]), *numbers]) == sorted(
        {*seqs_there, 3 if 3 not in seqs_there else 13}
    )
    assert (len(history), history.evict()) == (0, None)


def test_no_more_are_taken_than_asked_for() -> None:
    history = History()
    history.extend(queued("a", seq) for seq in range(1, 6))
    assert seqs(history.take(2)) == [("a", 1), ("a", 2)]
    assert len(history) == 3


def test_one_batch_never_mixes_boots() -> None:
    history = History()
    other = Sample("a", "j", 9, 0, "synced", None, {}, (), "bad", "timeout", None)
    history.extend([queued("a", 1), QueuedSample(other, 0.0)])
    assert [each.sample.boot for each in history.take(100)] == ["j"]


def test_evicting_takes_the_oldest() -> None:
    history = History()
    history.extend([queued("a", 1, 5.0), queued("b", 1, 4.0)])
    assert history.evict() == queued("b", 1, 4.0)
    assert len(history) == 1


def test_what_was_acknowledged_before_goes_first_and_all_at_once() -> None:
    history = History()
    history.extend([queued("a", 1), queued("a", 2, repeated=True), queued("b", 3, repeated=True)])
    assert history.evict() is None
    assert len(history) == 1
    assert seqs(history.take(100)) == [("a", 1)]
    assert history.take(100) == ()


@given(st.lists(st.tuples(st.sampled_from("ab"), st.integers(1, 50)), unique=True), st.integers(1, 10))
def test_whatever_the_order_of_arrival_each_device_leaves_in_order_of_seq(
    arrivals: list[tuple[str, int]], most: int
) -> None:
    history = History()
    history.extend(queued(device, seq, repeated=seq % 3 == 0) for device, seq in arrivals)
    left: list[tuple[str, int]] = []
    while taken := history.take(most):
        assert len(taken) <= most
        assert len({each.key for each in taken}) == 1
        left += seqs(taken)
    assert len(history) == 0
    for device in "ab":
        assert [each for each in left if each[0] == device] == sorted(each for each in arrivals if each[0] == device)


def test_a_clock_set_right_corrects_what_had_none_and_knows_its_shift() -> None:
    unsynced = replace(queued("a", 1).sample, clock="unsynced", ts=5000)
    history = History()
    history.extend(
        [QueuedSample(unsynced, 1.0, shift=1000), QueuedSample(replace(unsynced, seq=2), 2.0), queued("a", 3)]
    )
    history.correct(9000)
    told = [(each.sample.ts, each.sample.clock, each.shift) for each in history.take(9)]
    assert told == [(13_000, "synced", 9000), (5000, "unsynced", None), (0, "synced", None)]


def test_a_clock_that_was_set_corrects_what_waited_before_and_marks_it() -> None:
    unknown = replace(queued("a", 1).sample, clock="unknown", ts=5000)
    history = History()
    history.extend(
        [QueuedSample(unknown, 1.0, shift=1000), QueuedSample(replace(unknown, seq=2), 2.0, shift=8900), queued("a", 3)]
    )
    history.correct(9000, "unsynced")
    told = [(each.sample.ts, each.sample.clock, each.shift) for each in history.take(9)]
    assert told == [(13_000, "unsynced", 9000), (5000, "unknown", 8900), (0, "synced", None)]


def test_what_is_cleared_is_gone() -> None:
    history = History()
    history.extend([queued("a", 1), queued("b", 1, repeated=True)])
    history.clear()
    assert (len(history), history.take(9), history.evict()) == (0, (), None)


def test_it_tells_whether_a_sample_of_a_key_waits() -> None:
    history = History()
    one = queued("a", 1)
    assert one.key not in history
    history.add(one)
    assert one.key in history
    history.take(1)
    assert one.key not in history


def test_a_device_s_records_wait_beside_its_samples_and_go_one_by_one() -> None:
    history = History()
    history.extend([queued("a", 1), queued("a", 2), QueuedSample(record(1, "a"), 0.5), QueuedSample(record(2, "a"), 3)])
    assert ("a/record", "k") in history
    assert [each.sample for each in history.take(100)] == [record(1, "a")]
    assert seqs(history.take(100)) == [("a", 1), ("a", 2)]
    assert not history.waits({"a/record"})
    assert history.take(100, {"a/record"}) == ()
    assert [each.sample for each in history.take(100, {"a"})] == [record(2, "a")]
