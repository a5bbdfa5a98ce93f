"""Size and age of the file: the oldest goes, and each loss is declared."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from lfs10d.outbox.losses import Loss
from lfs10d.outbox.store.sample_file import SampleFile, StoreBatch
from lfs10d.system.clock_step import ClockState
from tests.support.rows import BOOT, ROOMY, START, entries, sample
from tests.support.sample_files import NOW, keep, kept, reopened

# Limits


@pytest.mark.parametrize("size", [1_000_000, 2_000_000])
def test_file_and_log_never_take_more_than_the_limit_and_the_oldest_goes_exactly_declared(
    path: Path, size: int
) -> None:
    file = SampleFile(path, boot=BOOT, limits=replace(ROOMY, size=size))
    lost: list[Loss] = []
    largest = 0
    for start in range(1, 70_001, 1000):
        lost += keep(file, *(sample(seq) for seq in range(start, start + 1000)))
        largest = max(largest, sum(each.stat().st_size for each in path.parent.iterdir()))
    left = [each.seq for each in kept(file)]
    file.close()
    assert largest <= size
    assert left == list(range(left[0], 70_001))
    assert len(left) > size / 100
    declared = [seq for loss in lost for seq in range(loss.from_seq, loss.to_seq + 1)]
    assert declared == list(range(1, left[0]))
    assert sum(loss.count for loss in lost) == len(declared)


def test_what_is_too_old_is_evicted_and_declared(path: Path) -> None:
    file = SampleFile(path, boot=BOOT, limits=replace(ROOMY, age=10_000))
    keep(file, *(sample(seq) for seq in range(1, 1001)))
    lost = file.append(StoreBatch(entries(sample(1001)), losses=(), now=START + 910_500, mono=START + 910_500 - START))
    assert lost == (Loss("a", BOOT, 1, 900, 900),)
    assert file.losses == lost
    assert [each.seq for each in kept(file)] == list(range(901, 1002))
    file.close()


DAY = 86_400_000
WEEK = 7 * DAY


@pytest.mark.parametrize("clock", ["unsynced", "unknown"])
@pytest.mark.parametrize("after", ["unsynced", "unknown", "synced"])
def test_a_gateway_that_began_400_days_back_loses_nothing_when_its_clock_is_set(
    path: Path, clock: ClockState, after: ClockState
) -> None:
    file = SampleFile(path, boot=BOOT, limits=replace(ROOMY, age=WEEK))
    back = START - 400 * DAY
    keep(file, *(sample(seq, clock=clock, ts=back + 1000 * seq) for seq in range(1, 101)), shift=back)
    assert (
        file.append(StoreBatch(entries(sample(101, clock=after)), losses=(), now=START + 101_000, mono=101_000)) == ()
    )
    assert file.rows == 101
    file.close()


@pytest.mark.parametrize("clock", ["unsynced", "unknown", "synced"])
def test_within_a_boot_age_is_monotonic_whatever_the_wall_clock_says(path: Path, clock: ClockState) -> None:
    file = SampleFile(path, boot=BOOT, limits=replace(ROOMY, age=10_000))
    keep(file, *(sample(seq, clock=clock) for seq in range(1, 1001)))
    lost = file.append(StoreBatch(entries(sample(1001, clock=clock)), losses=(), now=START - 400 * DAY, mono=910_500))
    assert lost == (Loss("a", BOOT, 1, 900, 900),)
    file.close()


@pytest.mark.parametrize(
    ("clock", "now", "lost"),
    [
        ("synced", "synced", 1),
        ("synced", "unknown", 0),
        ("synced", "unsynced", 0),
        ("unknown", "synced", 0),
        ("unsynced", "synced", 0),
    ],
)
def test_of_an_earlier_boot_the_age_is_known_where_the_clock_was_synchronised_then_and_is_now(
    path: Path, clock: ClockState, now: ClockState, lost: int
) -> None:
    file = SampleFile(path, boot=BOOT, limits=replace(ROOMY, age=10_000))
    keep(file, sample(1, boot="k0000001", clock=clock))
    evicted = file.append(StoreBatch(entries(sample(1, clock=now)), losses=(), now=START + 10**9, mono=1000))
    assert sum(loss.count for loss in evicted) == lost
    file.close()


def test_what_is_older_than_a_sample_that_is_too_old_is_too_old_itself(path: Path) -> None:
    """Where the clock is never synchronised, what earlier boots left goes with this boot's own."""
    file = SampleFile(path, boot=BOOT, limits=replace(ROOMY, age=10_000))
    keep(file, sample(1, boot="k0000001", clock="unknown"), sample(1, clock="unknown"))
    lost = file.append(StoreBatch(entries(sample(2, clock="unknown")), losses=(), now=START, mono=50_000))
    assert lost == (Loss("a", "k0000001", 1, 1, 1), Loss("a", BOOT, 1, 1, 1))
    file.close()


def test_what_is_under_way_stays_and_what_was_delivered_is_no_loss(path: Path) -> None:
    file = SampleFile(path, boot=BOOT, limits=replace(ROOMY, age=1000))
    keep(file, *(sample(seq) for seq in range(1, 7)))
    ids = [row.id for row in file.read(0, 6)]
    lost = file.append(
        StoreBatch(
            entries(sample(7)),
            losses=(),
            now=START + 10**6,
            mono=START + 10**6 - START,
            beyond=ids[1],
            delivered=frozenset({ids[3]}),
        )
    )
    assert lost == (Loss("a", BOOT, 3, 3, 1), Loss("a", BOOT, 5, 6, 2))
    assert [each.seq for each in kept(file)] == [1, 2, 7]
    file.close()


def test_what_is_only_repeated_is_no_loss(path: Path) -> None:
    file = SampleFile(path, boot=BOOT, limits=replace(ROOMY, age=1000))
    file.append(StoreBatch(entries(sample(1), repeated=True), losses=(), now=NOW, mono=NOW - START))
    assert file.append(StoreBatch(entries(sample(2)), losses=(), now=START + 10**6, mono=START + 10**6 - START)) == ()
    assert [each.seq for each in kept(file)] == [2]
    file.close()


def test_other_limits_hold_from_the_next_sample_on(file: SampleFile) -> None:
    keep(file, *(sample(seq) for seq in range(1, 4)))
    file.limit(replace(ROOMY, age=1000))
    assert file.append(StoreBatch(entries(sample(4)), losses=(), now=START + 10**6, mono=START + 10**6 - START)) == (
        Loss("a", BOOT, 1, 3, 3),
    )


# Losses


def test_losses_are_kept_across_a_restart_until_they_are_declared(file: SampleFile, path: Path) -> None:
    losses = (Loss("a", "k0000001", 1, 5, 5), Loss("b", BOOT, 2, 9, 3))
    file.append(StoreBatch(entries(sample(1)), losses=losses, now=NOW, mono=NOW - START))
    other = reopened(file, path)
    assert other.losses == losses
    other.delete([], losses=losses[1:])
    again = reopened(other, path)
    assert again.losses == losses[1:]
    again.close()
