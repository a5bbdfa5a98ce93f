"""The samples in the file: kept, read, let go, evicted, and never wrong whatever is cut off."""

from __future__ import annotations

import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest

from lfs10d.outbox.losses import Loss
from lfs10d.outbox.store.database import Limits
from lfs10d.outbox.store.sample_file import SampleFile, StoreBatch, runs
from lfs10d.telemetry.publication import Sample
from lfs10d.telemetry.wind.record import WindRecord
from tests.support.outbox_items import record
from tests.support.rows import BOOT, ROOMY, START, entries, sample
from tests.support.sample_files import NOW, keep, kept, reopened

# In and out


def test_samples_come_back_as_they_were_in_order_of_arrival_after_a_restart(file: SampleFile, path: Path) -> None:
    samples = [
        sample(1),
        sample(1, "b", values={"wind_speed": 12.99, "direction": 270, "gust": 1e300}),
        sample(2, error="timeout"),
        sample(2, "b", values={"wind_speed": -0.0, "direction": 5, "gust": 0.1}),
        sample(3, clock="unsynced", ts=5),
    ]
    keep(file, *samples)
    other = reopened(file, path, boot="k0000003")
    assert kept(other) == samples
    assert [row.shift for row in other.read(0, 9)] == [None] * 5
    assert other.rows == 5
    assert other.oldest() == samples[0].ts
    other.close()


def test_a_page_begins_after_an_id(file: SampleFile) -> None:
    keep(file, *(sample(seq) for seq in range(1, 6)))
    page = file.read(0, 2)
    assert [row.sample.seq for row in page] == [1, 2]
    assert [row.sample.seq for row in file.read(page[-1].id, 9)] == [3, 4, 5]


def test_what_is_let_go_is_gone_and_what_it_took_is_used_again(file: SampleFile, path: Path) -> None:
    keep(file, *(sample(seq, values={"x": seq, "y": 2}) for seq in range(1, 4001)))
    size = path.stat().st_size + path.with_name("backlog.db-wal").stat().st_size
    file.delete([row.id for row in file.read(0, 4000)], losses=())
    assert (file.rows, file.oldest(), kept(file)) == (0, None, [])
    assert path.stat().st_size < size / 4
    keep(file, sample(5000))
    assert [each.seq for each in kept(file)] == [5000]


def test_the_file_shrinks_while_most_of_it_is_free(file: SampleFile, path: Path) -> None:
    for start in range(1, 60_001, 2000):
        keep(file, *(sample(seq) for seq in range(start, start + 2000)))
    full = path.stat().st_size
    rows = file.read(0, 59_000)
    for start in range(0, 59_000, 1000):
        file.delete([row.id for row in rows[start : start + 1000]], losses=())
    file.close()
    assert path.stat().st_size < full / 2


def test_holes_between_what_is_let_go_stay(file: SampleFile) -> None:
    keep(file, *(sample(seq) for seq in range(1, 9)))
    rows = file.read(0, 8)
    file.delete([rows[0].id, rows[1].id, rows[4].id], losses=())
    assert [each.seq for each in kept(file)] == [3, 4, 6, 7, 8]
    assert file.rows == 5


def test_ids_go_on_where_the_caller_says(path: Path) -> None:
    file = SampleFile(path, boot=BOOT, limits=ROOMY, first=500)
    keep(file, sample(1))
    assert [row.id for row in file.read(0, 9)] == [500]
    file.close()


def test_a_sample_takes_about_thirty_bytes(file: SampleFile, path: Path) -> None:
    for start in range(1, 40_001, 8):
        if start % 1000 == 1:
            batch = [sample(seq, f"d{device}") for device in range(8) for seq in range(start, start + 125)]
            keep(file, *batch)
    rows = file.rows
    file.close()
    assert rows == 40_000
    assert path.stat().st_size / rows < 33


def test_runs_of_numbers() -> None:
    assert list(runs([])) == []
    assert list(runs({7})) == [(7, 7)]
    assert list(runs([9, 1, 2, 3, 5, 6])) == [(1, 3), (5, 6), (9, 9)]


# The clock


def test_a_clock_set_right_corrects_this_boots_samples_and_no_others(file: SampleFile, path: Path) -> None:
    keep(file, sample(1, boot="k0000001", clock="unsynced", ts=77))
    other = reopened(file, path)
    uptime = 500_000
    keep(other, sample(1, clock="unsynced", ts=uptime), shift=0)
    keep(other, sample(2, clock="unsynced", ts=uptime + 1000 + 50_000), shift=50_000)
    keep(other, sample(3, clock="synced", ts=START + uptime + 2000), shift=START)
    other.correct(START)
    right = [(77, "unsynced"), *((START + uptime + 1000 * n, "synced") for n in range(3))]
    assert [(each.ts, each.clock) for each in kept(other)] == right
    keep(other, sample(4, ts=START + uptime + 3000), shift=START)
    again = reopened(other, path)
    assert [(each.ts, each.clock) for each in kept(again)] == [*right, (START + uptime + 3000, "synced")]
    again.close()


# What happened though it failed


def test_samples_from_an_id_on_can_be_taken_back(file: SampleFile) -> None:
    keep(file, sample(1), sample(2))
    first = file.next
    assert not file.take_back(first)
    keep(file, sample(3), sample(4))
    assert file.take_back(first)
    assert [each.seq for each in kept(file)] == [1, 2]
    assert file.rows == 2


def test_a_transaction_that_fails_leaves_no_trace(file: SampleFile, path: Path) -> None:
    keep(file, sample(1))

    def fail(_: object) -> None:
        raise sqlite3.OperationalError("for the test")

    with pytest.raises(sqlite3.OperationalError, match="for the test"):
        file.append(StoreBatch(entries(sample(2)), losses=(), now=NOW, mono=NOW - START), fail)
    other = reopened(file, path)
    assert [each.seq for each in kept(other)] == [1]
    other.close()


# Records


def test_records_come_back_as_they_were_beside_the_samples_of_their_device(file: SampleFile, path: Path) -> None:
    kept_ones = [sample(1), record(1, boot=BOOT), sample(2), record(2, boot=BOOT)]
    keep(file, *kept_ones)
    again = reopened(file, path)
    assert kept(again) == kept_ones
    assert [type(each) for each in kept(again)] == [Sample, WindRecord, Sample, WindRecord]
    again.close()


def test_a_record_that_is_evicted_is_a_loss_of_records(path: Path) -> None:
    file = SampleFile(path, boot=BOOT, limits=Limits(size=ROOMY.size, age=1000))
    file.append(StoreBatch(entries(record(1, boot=BOOT), shift=0), losses=(), now=NOW, mono=600_000))
    lost = file.append(StoreBatch(entries(sample(2, ts=700_000), shift=0), losses=(), now=NOW, mono=700_000))
    assert lost == (Loss("a/record", BOOT, 1, 1, 1),)
    assert file.losses == lost
    file.close()


def test_a_clock_set_right_moves_all_times_of_a_record(file: SampleFile) -> None:
    keep(file, record(1, boot=BOOT, clock="unsynced"), shift=0)
    file.correct(5000)
    [right] = kept(file)
    assert right == replace(record(1, boot=BOOT), ts=605_000)
