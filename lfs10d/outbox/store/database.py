"""Opens one SQLite file of the store: created if there is none, refused if it is not ours or is damaged.

::

    life    the boot that opened it last
    era     one stretch of one boot in which the wall clock went on evenly: when it is set, one row is corrected
    series  what many samples have in common: device, boot, quality, error, names and units of the values
    sample  about 30 bytes each, in order of arrival, which for each device is the order of (boot, seq)
    further the second and every other value of a sample
    loss    what will never come and is not declared yet
"""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from lfs10d.outbox.store.row import DamagedError
from lfs10d.system.dataclass import dataclass
from lfs10d.system.regular_file import create_private, make_private

APPLICATION_ID = 0x4C465364
"""`LFSd` in the header says that a file is ours (https://www.sqlite.org/fileformat.html#application_id)."""

SCHEMA = 1
"""`user_version` of the header of a file whose samples have numbers alone, as it begins."""

WIDE_SCHEMA = 2
"""The same tables, in which a sample may be partial and a value text, a boolean, or have an age: an lfs10d that does
not know them leaves such a file alone. Higher ones were written by a later lfs10d."""

PAGE = 4096
"""Bytes of a page of the file."""

PATIENCE = 0.5
"""Seconds another program may hold the file."""

_TABLES = """
CREATE TABLE life (boot TEXT NOT NULL);
INSERT INTO life VALUES ('');
CREATE TABLE era (id INTEGER PRIMARY KEY, boot TEXT NOT NULL, clock TEXT NOT NULL, base INTEGER NOT NULL,
                  shift INTEGER NOT NULL, checked INTEGER NOT NULL);
CREATE TABLE series (id INTEGER PRIMARY KEY, era INTEGER NOT NULL, facts TEXT NOT NULL);
CREATE TABLE sample (id INTEGER PRIMARY KEY, series INTEGER NOT NULL, seq INTEGER NOT NULL, at INTEGER NOT NULL,
                     rtt, value, checked INTEGER NOT NULL);
CREATE TABLE further (sample INTEGER NOT NULL, place INTEGER NOT NULL, value, PRIMARY KEY (sample, place))
    WITHOUT ROWID;
CREATE TABLE loss (device TEXT NOT NULL, boot TEXT NOT NULL, from_seq INTEGER NOT NULL, to_seq INTEGER NOT NULL,
                   count INTEGER NOT NULL)
"""

_PRAGMAS = (
    "synchronous = FULL",
    "secure_delete = OFF",
    "cell_size_check = ON",
    "trusted_schema = OFF",
    "temp_store = MEMORY",
    "cache_size = -512",
)
"""https://www.sqlite.org/pragma.html; secure_delete would write every page that is freed."""


class ForeignError(Exception):
    """The file is a database of another program, or of a later lfs10d (`later`)."""

    def __init__(self, message: str, *, later: bool) -> None:
        super().__init__(message)
        self.later = later


@dataclass(frozen=True, slots=True)
class Limits:
    """Bytes that the file and what SQLite keeps beside it may take; age in ms above which a sample is evicted."""

    size: int
    age: int

    @property
    def log_pages(self) -> int:
        """Pages of the write-ahead log after which it is brought into the file; it grows a little beyond."""
        return max(32, min(256, self.size // PAGE // 8))

    @property
    def pages(self) -> int:
        """Pages of the file itself."""
        return self.size // PAGE - 2 * self.log_pages


def connect(path: Path, *, boot: str, limits: Limits) -> sqlite3.Connection:
    """Open the file, bring its log into it, and write `boot`. A file shorter than it says SQLite refuses itself.

    Only the owner may read it, whatever the umask is. Raises OSError, sqlite3.Error, ForeignError, or DamagedError
    where the file is cut.
    """
    create_private(path)  # SQLite gives what it keeps beside the file the rights of the file
    for beside in ("-wal", "-shm", "-journal"):
        make_private(path.with_name(f"{path.name}{beside}"))
    torn = _ends_within_a_page(path)
    db = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)
    try:
        _prepare(db)
        _refuse(torn)
        limit(db, limits)
        db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        with transaction(db):  # and so it shows whether the file can be written
            db.execute("UPDATE life SET boot = ?", (boot,))
    except BaseException:
        db.close()
        raise
    return db


def _prepare(db: sqlite3.Connection) -> None:
    db.execute("PRAGMA locking_mode = EXCLUSIVE")  # and no shared memory beside the file
    kind, schema = number(db, "PRAGMA application_id"), number(db, "PRAGMA user_version")
    tables = number(db, "SELECT count(*) FROM sqlite_schema")
    if kind != APPLICATION_ID and (kind or schema or tables):
        raise ForeignError("is a database of another program", later=False)
    if schema > WIDE_SCHEMA:
        raise ForeignError(f"was written by a later lfs10d (schema {schema}, ours is {WIDE_SCHEMA})", later=True)
    db.execute(f"PRAGMA page_size = {PAGE}")
    db.execute("PRAGMA auto_vacuum = INCREMENTAL")
    db.execute("PRAGMA journal_mode = WAL")
    for pragma in _PRAGMAS:
        db.execute(f"PRAGMA {pragma}")
    if not tables:
        with transaction(db):
            for statement in _TABLES.split(";"):
                db.execute(statement)
            db.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            db.execute(f"PRAGMA user_version = {SCHEMA}")


def _ends_within_a_page(path: Path) -> bool:
    """Return whether a file was cut. Where it has a log nobody knows: that may be about to complete it."""
    log = path.with_name(f"{path.name}-wal")
    return path.exists() and path.stat().st_size % PAGE > 0 and not (log.exists() and log.stat().st_size)


def _refuse(torn: bool) -> None:  # noqa: FBT001 - it says it all
    if torn:
        raise DamagedError("it is cut short")


def limit(db: sqlite3.Connection, limits: Limits) -> None:
    """Bound the write-ahead log."""
    db.execute(f"PRAGMA wal_autocheckpoint = {limits.log_pages}")
    db.execute(f"PRAGMA journal_size_limit = {limits.log_pages * PAGE}")


def is_wide(db: sqlite3.Connection) -> bool:
    """Whether samples may have more than numbers."""
    return number(db, "PRAGMA user_version") >= WIDE_SCHEMA


def widen(db: sqlite3.Connection) -> None:
    """Let samples have more than numbers from now on."""
    db.execute(f"PRAGMA user_version = {WIDE_SCHEMA}")


def number(db: sqlite3.Connection, question: str) -> int:
    """Return the one integer that answers a question."""
    answer: int = db.execute(question).fetchone()[0]
    return answer


@contextlib.contextmanager
def transaction(db: sqlite3.Connection) -> Iterator[None]:
    """Make what is done within it happen on the disk as one, or not at all."""
    db.execute("BEGIN IMMEDIATE")
    try:
        yield
        db.execute("COMMIT")
    except BaseException:
        if db.in_transaction:
            db.execute("ROLLBACK")
        raise
