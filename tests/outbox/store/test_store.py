"""Which file is used, what becomes of one that cannot be, and when nothing can be kept."""

from __future__ import annotations

import errno
import os
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from lfs10d.outbox.losses import Loss
from lfs10d.outbox.store.sample_file import StoreBatch
from lfs10d.outbox.store.store import ASIDE_MOST, FileSetAside, Store, StoreError
from lfs10d.system.disk import Disk, Files
from tests.support.rows import BOOT, ROOMY, START, entries, sample
from tests.support.stores import NOW, keep, kept, names

# The file


def test_the_folder_and_the_file_are_made(store: Store) -> None:
    assert store.open() == ()
    assert names(store) == {"backlog.db", "backlog.db-wal"}
    assert (store.rows, store.oldest_ts, store.losses) == (0, None, ())


def test_what_is_kept_is_there_after_a_restart_and_told(store: Store) -> None:
    loss = Loss("a", BOOT, 1, 1, 1)
    store.append(StoreBatch(entries(sample(2), sample(3)), losses=(loss,), now=NOW, mono=NOW - START))
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
    store.append(StoreBatch(entries(sample(1, clock="unsynced", ts=5), shift=0), losses=(), now=NOW, mono=NOW - START))
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


class Stubborn(Files):
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
