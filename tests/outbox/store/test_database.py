"""A file is opened if it is ours and whole, and made if there is none."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from lfs10d.outbox.store.database import (
    APPLICATION_ID,
    PAGE,
    SCHEMA,
    ForeignError,
    connect,
    is_wide,
    number,
    transaction,
    widen,
)
from lfs10d.outbox.store.row import DamagedError
from tests.support.rows import BOOT, ROOMY


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Give the path of a file that is not there yet."""
    return tmp_path / "f.db"


def test_a_new_file_says_whose_it_is_and_is_written_safely(path: Path) -> None:
    with closing(connect(path, boot=BOOT, limits=ROOMY)) as db:
        said = {
            name: db.execute(f"PRAGMA {name}").fetchone()[0]
            for name in ("application_id", "user_version", "journal_mode", "synchronous", "auto_vacuum", "page_size")
        }
        assert db.execute("SELECT boot FROM life").fetchall() == [(BOOT,)]
    assert said == {
        "application_id": APPLICATION_ID,
        "user_version": SCHEMA,
        "journal_mode": "wal",
        "synchronous": 2,
        "auto_vacuum": 2,
        "page_size": PAGE,
    }


def test_the_next_boot_is_noted(path: Path) -> None:
    for boot in (BOOT, "k0000009"):
        with closing(connect(path, boot=boot, limits=ROOMY)) as db:
            assert db.execute("SELECT boot FROM life").fetchall() == [(boot,)]


@pytest.mark.parametrize(("size", "log"), [(10**6, 32), (4 * 10**6, 122), (512 * 10**6, 256)])
def test_file_and_log_share_the_limit(size: int, log: int) -> None:
    limits = replace(ROOMY, size=size)
    assert limits.log_pages == log
    assert (limits.pages + 2 * limits.log_pages) * PAGE <= size


def test_a_later_schema_is_refused(path: Path) -> None:
    connect(path, boot=BOOT, limits=ROOMY).close()
    with closing(sqlite3.connect(path)) as db:
        db.execute("PRAGMA user_version = 3")
    with pytest.raises(ForeignError, match="schema 3, ours is 2") as refused:
        connect(path, boot=BOOT, limits=ROOMY)
    assert refused.value.later


def test_a_file_of_wide_samples_is_ours_and_stays_wide(path: Path) -> None:
    with closing(connect(path, boot=BOOT, limits=ROOMY)) as db:
        assert not is_wide(db)
        widen(db)
        assert is_wide(db)
    with closing(connect(path, boot=BOOT, limits=ROOMY)) as db:
        assert is_wide(db)


@pytest.mark.parametrize("statement", ["PRAGMA application_id = 7", "CREATE TABLE t (x)", "PRAGMA user_version = 3"])
def test_somebody_elses_database_is_refused_and_left_as_it_is(path: Path, statement: str) -> None:
    with closing(sqlite3.connect(path)) as db:
        db.execute(statement)
        db.commit()
    before = path.read_bytes()
    with pytest.raises(ForeignError, match="another program") as refused:
        connect(path, boot=BOOT, limits=ROOMY)
    assert not refused.value.later
    assert path.read_bytes() == before


def test_text_is_no_database(path: Path) -> None:
    path.write_text("not a database " * 1000)
    with pytest.raises(sqlite3.DatabaseError, match="not a database"):
        connect(path, boot=BOOT, limits=ROOMY)


def test_a_file_that_ends_within_a_page_is_refused(path: Path) -> None:
    connect(path, boot=BOOT, limits=ROOMY).close()
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(DamagedError, match="cut short"):
        connect(path, boot=BOOT, limits=ROOMY)


def test_a_file_that_its_log_may_complete_is_not_refused(path: Path) -> None:
    connect(path, boot=BOOT, limits=ROOMY).close()
    whole = path.read_bytes()
    with closing(connect(path, boot="k0000009", limits=ROOMY)):
        log = path.with_name("f.db-wal").read_bytes()
    path.write_bytes(whole[:-1])
    path.with_name("f.db-wal").write_bytes(log)
    with closing(connect(path, boot=BOOT, limits=ROOMY)) as db:
        assert number(db, "SELECT count(*) FROM life") == 1


def test_bytes_beyond_the_last_page_are_damage(path: Path) -> None:
    connect(path, boot=BOOT, limits=ROOMY).close()
    path.write_bytes(path.read_bytes() + b"x")
    with pytest.raises(DamagedError, match="cut short"):
        connect(path, boot=BOOT, limits=ROOMY)


@pytest.mark.parametrize("last", ["SELECT 1", "ROLLBACK"])
def test_a_transaction_happens_as_one_or_not_at_all(path: Path, last: str) -> None:
    """Also where SQLite has rolled back by itself already, as it does after some errors."""

    def fail(db: sqlite3.Connection) -> None:
        with transaction(db):
            db.execute("INSERT INTO further VALUES (1, 1, 1)")
            db.execute(last)
            raise ZeroDivisionError

    with closing(connect(path, boot=BOOT, limits=ROOMY)) as db:
        with pytest.raises(ZeroDivisionError):
            fail(db)
        assert number(db, "SELECT count(*) FROM further") == 0
        with transaction(db):
            db.execute("INSERT INTO further VALUES (1, 1, 1)")
        assert number(db, "SELECT count(*) FROM further") == 1


def test_nobody_but_the_owner_may_read_the_file_and_what_is_beside_it_whatever_was_before(tmp_path: Path) -> None:
    path = tmp_path / "backlog.db"
    for _ in range(2):
        db = connect(path, boot="k3f9a2c7", limits=ROOMY)
        with transaction(db):
            db.execute("UPDATE life SET boot = 'k3f9a2c8'")
        modes = {each.name: each.stat().st_mode & 0o777 for each in tmp_path.iterdir()}
        assert set(modes) >= {"backlog.db", "backlog.db-wal"}
        assert set(modes.values()) == {0o600}
        db.close()
        path.chmod(0o644)
        path.with_name("backlog.db-wal").touch()
        path.with_name("backlog.db-wal").chmod(0o644)
