"""The samples in the file: kept, read, let go, evicted, and never wrong whatever is cut off."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from lfs10d.outbox.losses import Loss
from lfs10d.outbox.store.database import Limits
from lfs10d.outbox.store.row import DamagedError
from lfs10d.outbox.store.sample_file import SampleFile, runs
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry.publication import Sample
from lfs10d.telemetry.wind.record import WindRecord
from tests.support.outbox_items import record
from tests.support.rows import BOOT, ROOMY, START, entries, sample

NOW = START + 60_000


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Give the path of a file that is not there yet."""
    return tmp_path / "backlog.db"


@pytest.fixture
def file(path: Path) -> Iterator[SampleFile]:
    """Give a new file."""
    opened = SampleFile(path, boot=BOOT, limits=ROOMY)
    yield opened
    opened.close()


def keep(file: SampleFile, *samples: Sample, shift: int = START) -> tuple[Loss, ...]:
    return file.append(entries(*samples, shift=shift), losses=file.losses, now=NOW, mono=NOW - START)


def kept(file: SampleFile) -> list[Sample]:
    return [row.sample for row in file.read(0, 1_000_000)]


def reopened(file: SampleFile, path: Path, *, boot: str = BOOT, limits: Limits = ROOMY) -> SampleFile:
    file.close()
    return SampleFile(path, boot=boot, limits=limits)


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
    lost = file.append(entries(sample(1001)), losses=(), now=START + 910_500, mono=START + 910_500 - START)
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
    assert file.append(entries(sample(101, clock=after)), losses=(), now=START + 101_000, mono=101_000) == ()
    assert file.rows == 101
    file.close()


@pytest.mark.parametrize("clock", ["unsynced", "unknown", "synced"])
def test_within_a_boot_age_is_monotonic_whatever_the_wall_clock_says(path: Path, clock: ClockState) -> None:
    file = SampleFile(path, boot=BOOT, limits=replace(ROOMY, age=10_000))
    keep(file, *(sample(seq, clock=clock) for seq in range(1, 1001)))
    lost = file.append(entries(sample(1001, clock=clock)), losses=(), now=START - 400 * DAY, mono=910_500)
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
    evicted = file.append(entries(sample(1, clock=now)), losses=(), now=START + 10**9, mono=1000)
    assert sum(loss.count for loss in evicted) == lost
    file.close()


def test_what_is_older_than_a_sample_that_is_too_old_is_too_old_itself(path: Path) -> None:
    """Where the clock is never synchronised, what earlier boots left goes with this boot's own."""
    file = SampleFile(path, boot=BOOT, limits=replace(ROOMY, age=10_000))
    keep(file, sample(1, boot="k0000001", clock="unknown"), sample(1, clock="unknown"))
    lost = file.append(entries(sample(2, clock="unknown")), losses=(), now=START, mono=50_000)
    assert lost == (Loss("a", "k0000001", 1, 1, 1), Loss("a", BOOT, 1, 1, 1))
    file.close()


def test_what_is_under_way_stays_and_what_was_delivered_is_no_loss(path: Path) -> None:
    file = SampleFile(path, boot=BOOT, limits=replace(ROOMY, age=1000))
    keep(file, *(sample(seq) for seq in range(1, 7)))
    ids = [row.id for row in file.read(0, 6)]
    lost = file.append(
        entries(sample(7)),
        losses=(),
        now=START + 10**6,
        mono=START + 10**6 - START,
        beyond=ids[1],
        delivered=frozenset({ids[3]}),
    )
    assert lost == (Loss("a", BOOT, 3, 3, 1), Loss("a", BOOT, 5, 6, 2))
    assert [each.seq for each in kept(file)] == [1, 2, 7]
    file.close()


def test_what_is_only_repeated_is_no_loss(path: Path) -> None:
    file = SampleFile(path, boot=BOOT, limits=replace(ROOMY, age=1000))
    file.append(entries(sample(1), repeated=True), losses=(), now=NOW, mono=NOW - START)
    assert file.append(entries(sample(2)), losses=(), now=START + 10**6, mono=START + 10**6 - START) == ()
    assert [each.seq for each in kept(file)] == [2]
    file.close()


def test_other_limits_hold_from_the_next_sample_on(file: SampleFile) -> None:
    keep(file, *(sample(seq) for seq in range(1, 4)))
    file.limit(replace(ROOMY, age=1000))
    assert file.append(entries(sample(4)), losses=(), now=START + 10**6, mono=START + 10**6 - START) == (
        Loss("a", BOOT, 1, 3, 3),
    )


# Losses


def test_losses_are_kept_across_a_restart_until_they_are_declared(file: SampleFile, path: Path) -> None:
    losses = (Loss("a", "k0000001", 1, 5, 5), Loss("b", BOOT, 2, 9, 3))
    file.append(entries(sample(1)), losses=losses, now=NOW, mono=NOW - START)
    other = reopened(file, path)
    assert other.losses == losses
    other.delete([], losses=losses[1:])
    again = reopened(other, path)
    assert again.losses == losses[1:]
    again.close()


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
        file.append(entries(sample(2)), losses=(), now=NOW, mono=NOW - START, about=fail)
    other = reopened(file, path)
    assert [each.seq for each in kept(other)] == [1]
    other.close()


# Samples that were changed


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE sample SET seq = seq + 1",
        "UPDATE sample SET value = x'00000000'",
        "UPDATE sample SET at = at + 1",
        "UPDATE sample SET rtt = 5",
        "UPDATE sample SET series = 99",
        "DELETE FROM further",
    ],
)
def test_a_sample_that_was_changed_is_never_read(file: SampleFile, path: Path, statement: str) -> None:
    keep(file, sample(1, values={"x": 1.5, "y": 2.5}))
    file.close()
    db = sqlite3.connect(path)
    db.execute(statement)
    db.commit()
    db.close()
    other = SampleFile(path, boot=BOOT, limits=ROOMY)
    with pytest.raises(DamagedError):
        other.read(0, 9)
    other.close()


# Cut anywhere


class Written:
    """A store's file as it lay on the disk, with what was committed when: `(bytes of the log, samples)`."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "backlog.db"
        self.log = folder / "backlog.db-wal"
        file = SampleFile(self.path, boot=BOOT, limits=ROOMY)
        self.committed = [(0, 0)]
        self.samples: list[Sample] = []
        for _ in range(12):
            batch = [sample(len(self.samples) + number) for number in range(1, 61)]
            keep(file, *batch)
            self.samples += batch
            self.committed.append((self.log.stat().st_size, len(self.samples)))
        self.file, self.wal = self.path.read_bytes(), self.log.read_bytes()
        file.close()

    def opened(self, folder: Path, file: bytes, wal: bytes) -> list[Sample] | None:
        """Return what a store finds in copies cut like this, None where it must put them aside."""
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        path = folder / "backlog.db"
        path.write_bytes(file)
        (folder / "backlog.db-wal").write_bytes(wal)
        try:
            store = SampleFile(path, boot=BOOT, limits=ROOMY)
        except (DamagedError, sqlite3.DatabaseError):
            return None
        try:
            return kept(store)
        except (DamagedError, sqlite3.DatabaseError):
            return None
        finally:
            store.close()


@pytest.fixture
def written(tmp_path: Path) -> Written:
    """Give a file with twelve commits in its log."""
    folder = tmp_path / "written"
    folder.mkdir()
    return Written(folder)


def scattered(count: int, below: int) -> list[int]:
    """Return numbers that follow no pattern of the file."""
    return [number * 2_654_435_761 % below for number in range(1, count + 1)]


FRAME = 24 + 4096
"""Bytes of a frame of the log; its header has 32 (https://www.sqlite.org/walformat.html)."""


def test_a_log_cut_at_any_frame_holds_what_was_committed_before_and_nothing_else(
    written: Written, tmp_path: Path
) -> None:
    frames = range(32, len(written.wal) + 1, FRAME)
    assert len(frames) > 24
    for cut in [0, *frames]:
        found = written.opened(tmp_path / "copy", written.file, written.wal[:cut])
        committed = max(count for size, count in written.committed if size <= cut)
        assert found == written.samples[:committed], f"cut at {cut}"


def test_a_log_cut_at_any_byte_or_with_flipped_bits_never_holds_a_wrong_sample(
    written: Written, tmp_path: Path
) -> None:
    for cut in scattered(60, len(written.wal)):
        found = written.opened(tmp_path / "copy", written.file, written.wal[:cut])
        assert found == written.samples[: max(count for size, count in written.committed if size <= cut)]
        flipped = bytearray(written.wal)
        flipped[cut] ^= 1 << cut % 8
        found = written.opened(tmp_path / "copy", written.file, bytes(flipped))
        assert found is None or found == written.samples[: len(found)]


def test_a_file_cut_at_any_byte_is_put_aside_or_never_holds_a_wrong_sample(written: Written, tmp_path: Path) -> None:
    """With its log beside it and, brought into the file, without."""
    whole = tmp_path / "whole"
    assert written.opened(whole, written.file, written.wal) == written.samples
    merged = (whole / "backlog.db").read_bytes()
    pages = range(0, len(merged), 4096)
    aside = 0
    for cut in [*pages, *scattered(60, len(merged)), *(page - 1 for page in pages if page)]:
        for file, wal in ((merged[:cut], b""), (written.file[:cut], written.wal), (merged[:cut], written.wal)):
            found = written.opened(tmp_path / "copy", file, wal)
            aside += found is None
            assert found is None or found == written.samples[: len(found)], f"cut at {cut}"
    assert aside > 60


def test_a_file_with_flipped_bits_never_holds_a_wrong_sample(written: Written, tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    written.opened(whole, written.file, written.wal)
    merged = (whole / "backlog.db").read_bytes()
    known = {each.seq: each for each in written.samples}
    for place in scattered(200, len(merged)):
        flipped = bytearray(merged)
        flipped[place] ^= 1 << place % 8
        for each in written.opened(tmp_path / "copy", bytes(flipped), b"") or []:
            assert each == known[each.seq]


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
    file.append(entries(record(1, boot=BOOT), shift=0), losses=(), now=NOW, mono=600_000)
    lost = file.append(entries(sample(2, ts=700_000), shift=0), losses=(), now=NOW, mono=700_000)
    assert lost == (Loss("a/record", BOOT, 1, 1, 1),)
    assert file.losses == lost
    file.close()


def test_a_clock_set_right_moves_all_times_of_a_record(file: SampleFile) -> None:
    keep(file, record(1, boot=BOOT, clock="unsynced"), shift=0)
    file.correct(5000)
    [right] = kept(file)
    assert right == replace(record(1, boot=BOOT), ts=605_000)
