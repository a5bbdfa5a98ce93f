"""A store on a disk that is full, refuses or hides that it wrote."""

from __future__ import annotations

import contextlib
import os
import sqlite3
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from lfs10d.outbox.losses import Loss
from lfs10d.outbox.store.sample_file import SampleFile, StoreBatch
from lfs10d.outbox.store.store import SMALLEST, Store, StoreError
from tests.support.rows import BOOT, ROOMY, START, entries, sample
from tests.support.stores import keep, kept, names


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
        store.append(StoreBatch(entries(sample(2), sample(3)), losses=(), now=late, mono=late - START))
    assert store.append(
        StoreBatch(entries(sample(2), sample(3), sample(4)), losses=(), now=START, mono=START - START)
    ) == (Loss("a", BOOT, 1, 1, 1),)
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
