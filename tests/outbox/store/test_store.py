"""Which file is used, what becomes of one that cannot be, and when nothing can be kept."""

from __future__ import annotations

import contextlib
import errno
import os
import sqlite3
import subprocess
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from lfs10d.outbox.losses import Loss
from lfs10d.outbox.store.sample_file import SampleFile
from lfs10d.outbox.store.store import ASIDE_MOST, SMALLEST, FileSetAside, Store, StoreError
from lfs10d.system.disk import Disk, SystemFiles
from lfs10d.telemetry.publication import Sample
from tests.support.rows import BOOT, ROOMY, START, entries, sample

NOW = START + 60_000


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    """Give a store in a folder that is not there yet."""
    made = Store(tmp_path / "state", boot=BOOT, limits=ROOMY)
    yield made
    made.close()


def keep(store: Store, *samples: Sample) -> tuple[Loss, ...]:
    return store.append(entries(*samples), losses=(), now=NOW, mono=NOW - START)


def kept(store: Store) -> list[int]:
    return [row.sample.seq for row in store.read(0, 1_000_000)]


def names(store: Store) -> set[str]:
    return {each.name for each in store.path.parent.iterdir()}


# The file


def test_the_folder_and_the_file_are_made(store: Store) -> None:
    assert store.open() == ()
    assert names(store) == {"backlog.db", "backlog.db-wal"}
    assert (store.rows, store.oldest_ts, store.losses) == (0, None, ())


def test_what_is_kept_is_there_after_a_restart_and_told(store: Store) -> None:
    loss = Loss("a", BOOT, 1, 1, 1)
    store.append(entries(sample(2), sample(3)), losses=(loss,), now=NOW, mono=NOW - START)
    store.close()
    assert store.open() == (loss,)
    assert (store.rows, store.oldest_ts) == (2, START + 2000)
    store.delete([row.id for row in store.read(0, 1)], losses=())
    assert (store.rows, store.oldest_ts, store.losses) == (1, START + 3000, ())


def test_an_empty_file_is_used(store: Store) -> None:
    store.path.parent.mkdir()
    store.path.touch()
    keep(store, sample(1))
    assert kept(store) == [1]
    assert not store.reports


def test_the_clock_and_the_limits_reach_the_file(store: Store) -> None:
    store.append(entries(sample(1, clock="unsynced", ts=5), shift=0), losses=(), now=NOW, mono=NOW - START)
    store.correct(START)
    assert store.read(0, 1)[0].sample.ts == START + 5
    store.limit(replace(ROOMY, age=1))
    assert keep(store, sample(2)) == (Loss("a", BOOT, 1, 1, 1),)


# Files put aside


def test_text_in_its_place_is_put_aside_whole_and_reported(store: Store) -> None:
    store.path.parent.mkdir()
    store.path.write_text("not a database " * 1000)
    assert store.open() == ()
    keep(store, sample(1))
    aside = store.path.with_name(f"backlog.db.corrupt-{BOOT}")
    assert aside.read_text() == "not a database " * 1000
    assert list(store.reports) == [FileSetAside(aside, "is damaged: file is not a database")]
    assert kept(store) == [1]


def test_a_later_schema_is_put_aside_unharmed(store: Store) -> None:
    keep(store, sample(1))
    store.close()
    with closing(sqlite3.connect(store.path)) as db:
        db.execute("PRAGMA user_version = 9")
    before = store.path.read_bytes()
    store.open()
    aside = store.path.with_name(f"backlog.db.later-{BOOT}")
    assert aside.read_bytes() == before
    assert [report.path for report in store.reports] == [aside]
    assert store.rows == 0


def test_a_second_file_of_one_boot_gets_a_name_of_its_own(store: Store) -> None:
    store.path.parent.mkdir()
    for _ in range(2):
        store.close()
        store.path.write_text("x" * 5000)
        store.open()
    assert {f"backlog.db.corrupt-{BOOT}", f"backlog.db.corrupt-{BOOT}.2"} < names(store)


def test_the_log_of_a_file_put_aside_is_not_taken_for_the_new_ones(store: Store, tmp_path: Path) -> None:
    other = Store(tmp_path / "other", boot=BOOT, limits=ROOMY)
    keep(other, sample(1), sample(2))
    log = other.path.with_name("backlog.db-wal").read_bytes()
    other.close()
    store.path.parent.mkdir()
    store.path.write_text("x" * 5000)
    store.path.with_name("backlog.db-wal").write_bytes(log)
    store.open()
    assert kept(store) == []


def _damage(path: Path) -> None:
    with closing(sqlite3.connect(path)) as db:
        db.execute("UPDATE sample SET seq = 7 WHERE id = 2")
        db.commit()


def test_damage_found_later_is_put_aside_and_ids_are_not_used_again(store: Store) -> None:
    keep(store, sample(1), sample(2))
    store.close()
    _damage(store.path)
    store.open()
    assert kept(store) == []
    keep(store, sample(3))
    assert [row.id for row in store.read(0, 9)] == [3]
    assert len(store.reports) == 1


def test_a_disk_that_damages_file_after_file_is_given_up(store: Store) -> None:
    for _ in range(ASIDE_MOST):
        store.close()
        store.path.parent.mkdir(exist_ok=True)
        store.path.write_text("x" * 5000)
        store.open()
    store.close()
    store.path.write_text("x" * 5000)
    with pytest.raises(StoreError, match="again and again"):
        store.open()


class Stubborn(SystemFiles):
    """Files that cannot be renamed."""

    def rename(self, source: Path, target: Path) -> None:
        """Refuse."""
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(source), None, str(target))


def test_a_damaged_file_that_cannot_be_renamed_is_no_place_for_samples(tmp_path: Path) -> None:
    store = Store(tmp_path, boot=BOOT, limits=ROOMY, disk=Disk(Stubborn()))
    store.path.write_text("x" * 5000)
    with pytest.raises(StoreError, match="cannot be renamed: read-only file system"):
        store.open()
    assert store.path.read_text() == "x" * 5000


# Nothing can be kept


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    store = Store(tmp_path / "file" / "state", boot=BOOT, limits=ROOMY)
    with pytest.raises(StoreError, match=r"state/backlog\.db: not a directory"):
        store.open()


def test_a_place_that_is_a_folder_is_told_and_left_alone(store: Store) -> None:
    store.path.mkdir(parents=True)
    with pytest.raises(StoreError, match="is a directory"):
        store.open()
    assert store.path.is_dir()


def test_a_file_that_another_program_holds_is_told_and_left_alone(store: Store) -> None:
    keep(store, sample(1))
    other = Store(store.path.parent, boot="k0000009", limits=ROOMY)
    with pytest.raises(StoreError, match="another program holds it"):
        other.open()
    assert kept(store) == [1]


class Failing:
    """A connection on which one statement fails with one of SQLite's codes, as often as told."""

    def __init__(self, file: SampleFile, word: str, code: int, *, after: bool = False) -> None:
        self._db = file._db
        self._word = word
        self._code = code
        self._after = after
        file._db = self  # type: ignore[assignment]  # it quacks

    def execute(self, statement: str, *arguments: object) -> object:
        """Execute, or fail before or after that."""
        if statement.startswith(self._word):
            if self._after:
                self._db.execute(statement, *arguments)  # type: ignore[arg-type]  # passed on
            error = sqlite3.OperationalError("for the test")
            error.sqlite_errorcode = self._code
            raise error
        return self._db.execute(statement, *arguments)  # type: ignore[arg-type]  # passed on

    def __getattr__(self, name: str) -> object:
        return getattr(self._db, name)


@dataclass
class SmallDisk:
    """A disk of 256 kB that can be filled; where mounting is not permitted, a store's file that says so."""

    folder: Path
    mounted: bool

    def fill(self, store: Store) -> None:
        """Take all room that is left."""
        if not self.mounted:
            assert store._file is not None
            Failing(store._file, "INSERT INTO sample", sqlite3.SQLITE_FULL)
            return
        with (self.folder / "ballast").open("wb", buffering=0) as file, contextlib.suppress(OSError):
            while file.tell() < 512 * 1024:
                file.write(bytes(4096))

    def empty(self) -> None:
        """Give the room back."""
        (self.folder / "ballast").unlink(missing_ok=True)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[SmallDisk]:
    """Give a small disk."""
    place = tmp_path / "disk"
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(place)]
    mounted = os.geteuid() == 0 and subprocess.run(command, check=False, capture_output=True).returncode == 0
    yield SmallDisk(place, mounted)
    if mounted:
        subprocess.run(["umount", "-l", str(place)], check=True)


def test_on_a_full_disk_nothing_is_lost_that_was_kept_and_it_goes_on_when_there_is_room(small_disk: SmallDisk) -> None:
    store = Store(small_disk.folder, boot=BOOT, limits=ROOMY)
    keep(store, *(sample(seq) for seq in range(1, 101)))
    small_disk.fill(store)
    with pytest.raises(StoreError, match="the disk is full"):
        keep(store, *(sample(seq) for seq in range(101, 3000)))
    small_disk.empty()
    keep(store, *(sample(seq) for seq in range(101, 201)))
    assert kept(store) == list(range(1, 201))
    store.close()


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (sqlite3.SQLITE_FULL, "the disk is full: free some space"),
        (sqlite3.SQLITE_READONLY, "it cannot be written"),
        (sqlite3.SQLITE_IOERR | 4 << 8, "the disk fails"),
        (sqlite3.SQLITE_PROTOCOL, "for the test"),
    ],
)
def test_a_disk_that_refuses_to_write_is_told_and_what_was_kept_stays(store: Store, code: int, words: str) -> None:
    keep(store, sample(1))
    assert store._file is not None
    Failing(store._file, "INSERT INTO sample", code)
    with pytest.raises(StoreError, match=words):
        keep(store, sample(2))
    keep(store, sample(2))
    assert kept(store) == [1, 2]
    assert not store.reports


def test_a_commit_that_happened_though_it_failed_is_not_kept_twice(store: Store) -> None:
    store.limit(replace(ROOMY, age=1000))
    keep(store, sample(1))
    assert store._file is not None
    Failing(store._file, "COMMIT", sqlite3.SQLITE_IOERR, after=True)
    late = START + 10**7
    with pytest.raises(StoreError):
        store.append(entries(sample(2), sample(3)), losses=(), now=late, mono=late - START)
    assert store.append(entries(sample(2), sample(3), sample(4)), losses=(), now=START, mono=START - START) == (
        Loss("a", BOOT, 1, 1, 1),
    )
    assert store.losses == (Loss("a", BOOT, 1, 1, 1),)
    assert kept(store) == [2, 3, 4]


def test_a_commit_that_did_not_happen_leaves_nothing_to_take_back(store: Store) -> None:
    keep(store, sample(1))
    assert store._file is not None
    Failing(store._file, "COMMIT", sqlite3.SQLITE_IOERR)
    with pytest.raises(StoreError):
        keep(store, sample(2))
    assert keep(store, sample(2), sample(3)) == ()
    assert kept(store) == [1, 2, 3]


# Nothing shall be kept


def test_below_a_megabyte_no_file_is_made(tmp_path: Path) -> None:
    store = Store(tmp_path, boot=BOOT, limits=replace(ROOMY, size=SMALLEST - 1))
    assert store.open() == ()
    store.delete([], losses=())
    store.correct(START)
    assert not store.open_for_more
    assert names(store) == set()


def test_a_backlog_of_before_still_leaves_where_no_more_is_kept(store: Store) -> None:
    keep(store, sample(1))
    store.close()
    other = Store(store.path.parent, boot="k0000009", limits=replace(ROOMY, size=0))
    other.open()
    assert kept(other) == [1]
    other.delete([1], losses=())
    assert other.rows == 0
    other.close()


@pytest.mark.parametrize("act", ["delete", "correct"])
def test_every_act_opens_the_file_by_itself(store: Store, act: str) -> None:
    acts: dict[str, Callable[[], None]] = {
        "delete": lambda: store.delete([], losses=()),
        "correct": lambda: store.correct(START),
    }
    acts[act]()
    assert "backlog.db" in names(store)
