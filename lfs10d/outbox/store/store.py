"""The backlog on disk: opens or replaces its file, and reports when nothing can be kept. Limits: `sample_file`.

=======================================  ================================================================
the file                                 what is done
=======================================  ================================================================
absent, empty                            it is made
ours                                     it is used
damaged, cut, no database, another's     it is renamed to `<name>.corrupt-<boot>`, and a new one is made
of a later lfs10d                        it is renamed to `<name>.later-<boot>`, and a new one is made
full disk, read-only, held by another    StoreError; what is to be kept stays with the caller, who tries again
=======================================  ================================================================

All methods block and belong to one thread; `rows`, `oldest_ts`, `losses` and `reports` may be read in between.
"""

from __future__ import annotations

import errno
import sqlite3
from collections import deque
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

from lfs10d.errors import StateError
from lfs10d.outbox.losses import Loss
from lfs10d.outbox.store.database import ForeignError, Limits
from lfs10d.outbox.store.row import DamagedError
from lfs10d.outbox.store.sample_file import SampleFile, StoreBatch, StoredRow
from lfs10d.system.clock_step import ClockState
from lfs10d.system.dataclass import dataclass
from lfs10d.system.disk import Disk

T = TypeVar("T")

FILE_NAME = "backlog.db"

SMALLEST = 1_000_000
"""`store.max_size` below which nothing is kept on disk: SQLite's own log needs its room too."""

ASIDE_MOST = 3
"""Files put aside in one life of the daemon; a disk that damages more of them is not written to any more."""

_BESIDE = ("", "-wal", "-shm", "-journal")
"""What SQLite keeps beside the file (https://www.sqlite.org/tempfiles.html)."""

_DAMAGED = frozenset({sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR, sqlite3.SQLITE_MISMATCH})
"""Primary result codes that speak of the content; SQLITE_ERROR: the tables are not ours."""

_WORDS = {
    sqlite3.SQLITE_FULL: "the disk is full: free some space, or make store.max_size smaller",
    sqlite3.SQLITE_READONLY: "it cannot be written: check its owner, its mode and how the disk is mounted",
    sqlite3.SQLITE_CANTOPEN: "it cannot be opened: check the state directory, its owner and its mode",
    sqlite3.SQLITE_PERM: "it cannot be opened: check its owner and its mode",
    sqlite3.SQLITE_IOERR: "the disk fails: see the system's log",
    sqlite3.SQLITE_BUSY: "another program holds it",
    sqlite3.SQLITE_LOCKED: "another program holds it",
    sqlite3.SQLITE_NOMEM: "there is no memory left",
}


class StoreError(StateError):
    """The backlog cannot be kept on disk now; published as `storage_full`. Tried again for ever by `run`."""


@dataclass(frozen=True, slots=True)
class FileSetAside:
    """A file that was put aside: where it is now, and why."""

    path: Path
    reason: str


class Store:
    """The backlog in `folder`, which is made if it is missing."""

    def __init__(self, folder: Path, *, boot: str, limits: Limits, disk: Disk | None = None) -> None:
        self.path = folder / FILE_NAME
        self._boot = boot
        self._limits = limits
        self._disk = Disk() if disk is None else disk
        self._file: SampleFile | None = None
        self._next = 1
        self._doubtful: tuple[int, tuple[Loss, ...]] | None = None
        self._aside = 0
        self.reports: deque[FileSetAside] = deque()
        """Files put aside that are not reported yet."""
        self.rows = 0
        """Samples on the disk."""
        self.oldest_ts: int | None = None
        """`ts` of the oldest of them."""
        self.losses: tuple[Loss, ...] = ()
        """The losses to be reported."""

    @property
    def open_for_more(self) -> bool:
        """There is room for samples by configuration."""
        return self._limits.size >= SMALLEST

    def limit(self, limits: Limits) -> None:
        """Take other limits; they hold from the next `append` on."""
        self._limits = limits
        if self._file is not None:
            self._use(lambda file: file.limit(limits))

    def open(self) -> tuple[Loss, ...]:
        """Open the file and try to write to it; return the losses that are to be declared. Raises StoreError."""
        if self._unused:
            return ()
        self.close()
        return self._use(lambda file: file.losses)

    @property
    def _unused(self) -> bool:
        """There is no file, and there shall be none."""
        return self._file is None and not self.open_for_more and not self.path.exists()

    def append(self, batch: StoreBatch) -> tuple[Loss, ...]:
        """Keep samples, as `SampleFile.append` does. Raises StoreError: then they are not kept."""

        def append(file: SampleFile) -> tuple[Loss, ...]:
            before = self._settle_doubt(file)
            doubt = partial(self._doubt, file.next)
            doubt(())
            evicted = file.append(replace(batch, losses=(*batch.losses, *before)), doubt)
            self._doubtful = None
            return (*before, *evicted)

        return self._use(append)

    def _doubt(self, first: int, evicted: tuple[Loss, ...]) -> None:
        """Note what will have been kept, from id `first` on, and evicted if a transaction that fails has happened."""
        self._doubtful = first, evicted

    def _settle_doubt(self, file: SampleFile) -> tuple[Loss, ...]:
        """Take back samples whose writing failed and happened nevertheless; return what was evicted by that."""
        if self._doubtful is None:
            return ()
        first, evicted = self._doubtful
        self._doubtful = None
        return evicted if file.take_back(first) else ()

    def read(self, after: int, most: int) -> list[StoredRow]:
        """Return up to `most` samples of ids above `after`, the oldest first. Raises StoreError."""
        return self._use(lambda file: file.read(after, most))

    def delete(self, ids: Collection[int], *, losses: Sequence[Loss]) -> None:
        """Let these go, and keep `losses` as those to be declared. Raises StoreError."""
        if not self._unused:
            self._use(lambda file: file.delete(ids, losses=losses))

    def correct(self, shift: int, clock: ClockState = "synced") -> None:
        """Set the time of this boot's samples right, as `SampleFile.correct` does. Raises StoreError."""
        if not self._unused:
            self._use(lambda file: file.correct(shift, clock))

    # The file

    def _use(self, operation: Callable[[SampleFile], T]) -> T:
        """Do something with the file; if it turns out not to be ours, do it with a new one."""
        while True:
            try:
                file = self._open()
                result = operation(file)
                self.rows, self.oldest_ts, self.losses = file.rows, file.oldest(), file.losses
            except (DamagedError, ForeignError, sqlite3.Error, OSError) as error:
                self.close()
                reason = _reason_to_put_aside(error)
                if reason is None:
                    raise StoreError(f"the backlog {self.path}: {_in_words(error)}") from None
                self._put_aside(reason, later=isinstance(error, ForeignError) and error.later)
            else:
                self._next = file.next
                return result

    def _open(self) -> SampleFile:
        if self._file is None:
            self.path.parent.mkdir(mode=0o750, parents=True, exist_ok=True)
            self._file = SampleFile(self.path, boot=self._boot, limits=self._limits, first=self._next)
        return self._file

    def close(self) -> None:
        """Let go of the file."""
        file, self._file = self._file, None
        if file is not None:
            self._next = max(self._next, file.next)
            file.close()

    def _put_aside(self, reason: str, *, later: bool) -> None:
        self._aside += 1
        if self._aside > ASIDE_MOST:
            raise StoreError(f"the backlog {self.path} is damaged again and again ({reason}): is the disk failing?")
        target = self._free_name("later" if later else "corrupt")
        files = self._disk.files
        try:
            for beside in reversed(_BESIDE):  # the file itself last: it is what a next start would find
                if files.exists(Path(f"{self.path}{beside}")):
                    files.rename(Path(f"{self.path}{beside}"), Path(f"{target}{beside}"))
            files.sync_folder(self.path.parent)
        except OSError as error:
            raise StoreError(f"the backlog {self.path} {reason} and cannot be renamed: {_in_words(error)}") from None
        self.rows, self.oldest_ts = 0, None
        self.reports.append(FileSetAside(target, reason))

    def _free_name(self, word: str) -> Path:
        name = f"{self.path.name}.{word}-{self._boot}"
        target = self.path.with_name(name)
        number = 1
        while self._disk.files.exists(target):
            number += 1
            target = self.path.with_name(f"{name}.{number}")
        return target


def _reason_to_put_aside(error: Exception) -> str | None:
    """Return why a file cannot be used, None where the reason is not its content."""
    match error:
        case DamagedError():
            return f"is damaged: {error}"
        case ForeignError():
            return str(error)
        case sqlite3.Error() if _primary(error) in _DAMAGED:
            return f"is damaged: {error}"
        case _:
            return None


def _primary(error: sqlite3.Error) -> int:
    """Return SQLite's primary result code (https://www.sqlite.org/rescode.html); text that is none has no code."""
    return getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF


def _in_words(error: Exception) -> str:
    if isinstance(error, OSError):
        code = sqlite3.SQLITE_FULL if error.errno in (errno.ENOSPC, errno.EDQUOT) else None
        return _WORDS[code] if code is not None else (error.strerror or str(error)).lower()
    assert isinstance(error, sqlite3.Error)  # noqa: S101 - the others are reasons to put aside
    return _WORDS.get(_primary(error), str(error))
