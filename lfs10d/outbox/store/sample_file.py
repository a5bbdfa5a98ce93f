"""The samples in one SQLite file: written, read, deleted, and evicted above the limits of size and age.

All methods block, and belong to one thread. Each is one transaction: it has happened on the disk, or raises
sqlite3.Error or DamagedError; then the file is to be closed, since nobody knows what of it has happened.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from collections.abc import Set as AbstractSet
from pathlib import Path

from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.losses import Loss, Losses
from lfs10d.outbox.store import database
from lfs10d.outbox.store.catalogue import Catalogue
from lfs10d.outbox.store.database import PAGE, Limits, number, transaction
from lfs10d.outbox.store.row import (
    Cell,
    DamagedError,
    beyond_first_schema,
    check,
    content_of,
    pack_rtt,
    unpack_rtt,
    values_of,
)
from lfs10d.system.clock_step import ClockState
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import Sample
from lfs10d.telemetry.wind.record import WindRecord, device_of_source, is_record

EVICTED_AT_ONCE = 256
"""Samples evicted in one go: two pages."""

BYTES_PER_SAMPLE = 64
"""More than a sample takes, to make room before it is written."""

VACUUMED_AT_ONCE = 256
"""Pages given back in one transaction."""


@dataclass(frozen=True, slots=True)
class StoreBatch:
    """Samples to be kept, at least one. `losses` are those to be declared so far, which are kept too.

    `now` is epoch ms, `mono` the monotonic clock in ms. Rows up to id `beyond` are under way to the broker and stay;
    the going of rows `delivered` is no loss.
    """

    samples: Sequence[QueuedSample]
    losses: Sequence[Loss]
    now: int
    mono: int
    beyond: int = 0
    delivered: AbstractSet[int] = frozenset()


@dataclass(frozen=True, slots=True)
class StoredRow:
    """A sample that is kept. `shift` is None for one of an earlier boot."""

    id: int
    sample: Sample
    shift: int | None
    repeated: bool


class SampleFile:
    """The file at `path`, made if there is none; `first` is the least id of what is appended.

    Raises as the methods do, and ForeignError.
    """

    def __init__(self, path: Path, *, boot: str, limits: Limits, first: int = 1) -> None:
        self._boot = boot
        self._limits = limits
        self._db = database.connect(path, boot=boot, limits=limits)
        try:
            self._catalogue = Catalogue(self._db, boot=boot)
            self._wide = database.is_wide(self._db)
            self.losses = tuple(
                Loss(*each) for each in self._db.execute("SELECT device, boot, from_seq, to_seq, count FROM loss")
            )
            """The table of losses."""
            self.rows = number(self._db, "SELECT count(*) FROM sample")  # reads every page of them
            """Samples in the file."""
            self.next = max(first, 1 + number(self._db, "SELECT coalesce(max(id), 0) FROM sample"))
            """The id of the next sample."""
        except BaseException:
            self._db.close()
            raise

    def limit(self, limits: Limits) -> None:
        """Take other limits; they hold from the next `append` on."""
        self._limits = limits
        database.limit(self._db, limits)

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    # In

    def append(self, batch: StoreBatch, about: Callable[[tuple[Loss, ...]], None] = lambda _: None) -> tuple[Loss, ...]:
        """Keep samples, evict the oldest where there is no room or they are too old; return what is lost by that.

        `about` is told what is lost before that is so.
        """
        with transaction(self._db):
            evicted = self._evict(batch)
            for queued in batch.samples:
                self._insert(queued)
            self._keep_losses((*batch.losses, *evicted))
            about(evicted)
        self.rows += len(batch.samples)
        return evicted

    def _insert(self, queued: QueuedSample) -> None:
        sample = queued.sample
        series_id, series, base = self._catalogue.place(sample, queued.shift or 0, repeated=queued.repeated)
        key, at, rtt = self.next, sample.ts - base, pack_rtt(sample.rtt_ms)
        cells = values_of(sample)
        if not self._wide and (beyond_first_schema(cells) or is_record(sample.source)):
            database.widen(self._db)
            self._wide = True
        first, *others = cells or (None,)
        checked = check(series.text, sample.seq, at, rtt, first, *others)
        self._db.execute(
            "INSERT INTO sample VALUES (?, ?, ?, ?, ?, ?, ?)", (key, series_id, sample.seq, at, rtt, first, checked)
        )
        if others:
            self._db.executemany(
                "INSERT INTO further VALUES (?, ?, ?)", [(key, place, value) for place, value in enumerate(others, 1)]
            )
        self.next += 1

    def take_back(self, first: int) -> bool:
        """Delete the samples from id `first` on; return True if there were any."""
        before = self.rows
        with transaction(self._db):
            self._delete(first, self.next)
        return self.rows < before

    # Out

    def read(self, after: int, most: int) -> list[StoredRow]:
        """Return up to `most` samples of ids above `after`, the oldest first."""
        found = self._db.execute(
            "SELECT id, series, seq, at, rtt, value, checked FROM sample WHERE id > ? ORDER BY id LIMIT ?",
            (after, most),
        ).fetchall()
        further: dict[int, list[Cell]] = {}
        if found:
            for key, value in self._db.execute(
                "SELECT sample, value FROM further WHERE sample BETWEEN ? AND ? ORDER BY sample, place",
                (found[0][0], found[-1][0]),
            ):
                further.setdefault(key, []).append(value)
        return [self._row(columns, further.get(columns[0], [])) for columns in found]

    def _row(self, columns: tuple[int, int, int, int, Cell, Cell, int], others: list[Cell]) -> StoredRow:
        key, series_id, seq, at, rtt, value, checked = columns
        era, series = self._catalogue.find(series_id)
        if check(series.text, seq, at, rtt, value, *others) != checked:
            raise DamagedError("a sample is not what was written")
        form = WindRecord if is_record(series.source) else Sample
        sample = form(
            device=device_of_source(series.source),
            boot=series.boot,
            seq=seq,
            ts=era.base + at,
            clock=era.clock,
            units=dict(series.units),
            names=series.names,
            quality=series.quality,
            error=series.error,
            rtt_ms=unpack_rtt(rtt),
            **content_of(series, (value, *others))._asdict(),
        )
        return StoredRow(key, sample, era.shift if era.boot == self._boot else None, series.repeated)

    def oldest(self) -> int | None:
        """Return the `ts` of the oldest sample, None where there is none."""
        return next((row.sample.ts for row in self.read(0, 1)), None)

    def delete(self, ids: Collection[int], *, losses: Sequence[Loss]) -> None:
        """Delete these, and keep `losses` as those to be declared; give back what room is no longer needed."""
        with transaction(self._db):
            for first, last in runs(ids):
                self._delete(first, last)
            if not self.rows:
                self._catalogue.clear()
            self._keep_losses(losses)
        free = number(self._db, "PRAGMA freelist_count")
        if free > VACUUMED_AT_ONCE and free > number(self._db, "PRAGMA page_count") // 2:
            # Where most of the file is free: so every page is moved once at most. One page at each step of the
            # statement, which `execute` makes only one of.
            self._db.executescript(f"PRAGMA incremental_vacuum({VACUUMED_AT_ONCE})")
        elif free and not self.rows:
            self._db.executescript("PRAGMA incremental_vacuum; PRAGMA wal_checkpoint(TRUNCATE)")

    def _delete(self, first: int, last: int) -> None:
        self.rows -= self._db.execute("DELETE FROM sample WHERE id BETWEEN ? AND ?", (first, last)).rowcount
        self._db.execute("DELETE FROM further WHERE sample BETWEEN ? AND ?", (first, last))

    # Evicting

    def _evict(self, batch: StoreBatch) -> tuple[Loss, ...]:
        lost = Losses()
        now = batch.now if batch.samples[-1].sample.clock == "synced" else None
        room = self._limits.pages - len(batch.samples) * BYTES_PER_SAMPLE // PAGE
        while self.rows:
            found = self._db.execute(
                "SELECT id, series, seq, at FROM sample WHERE id > ? ORDER BY id LIMIT ?",
                (batch.beyond, EVICTED_AT_ONCE),
            ).fetchall()
            if number(self._db, "PRAGMA page_count") - number(self._db, "PRAGMA freelist_count") <= room:
                found = found[: self._too_old(found, now, batch.mono)]
            if not found:
                break
            for key, series_id, seq, _ in found:
                _, series = self._catalogue.find(series_id)
                if key not in batch.delivered and not series.repeated:
                    lost.restore(Loss(series.source, series.boot, seq, seq, 1))
            self._delete(found[0][0], found[-1][0])
        return tuple(lost.undeclared())

    def _too_old(self, found: Sequence[tuple[int, int, int, int]], now: int | None, mono: int) -> int:
        """Return how many of the rows are too old: all up to the last one of which it is certain.

        Within this boot the monotonic clock knows, whatever becomes of the wall clock. Of an earlier boot the wall
        clock does, if it was synchronised then and is now (`now`, else None): where it was not, nobody knows.
        """
        count = 0
        for place, (_, series_id, _, at) in enumerate(found, 1):
            era, _ = self._catalogue.find(series_id)
            if era.boot == self._boot:
                age: int | None = mono - (era.base + at - era.shift)
            else:
                age = None if now is None or era.clock != "synced" else now - (era.base + at)
            if age is not None and age > self._limits.age:
                count = place
        return count

    # What else is kept

    def correct(self, shift: int, clock: ClockState = "synced") -> None:
        """Give this boot's samples the time that the clock tells now, as `Catalogue.correct` does."""
        with transaction(self._db):
            self._catalogue.correct(shift, clock)

    def _keep_losses(self, losses: Sequence[Loss]) -> None:
        if tuple(losses) != self.losses:
            self._db.execute("DELETE FROM loss")
            self._db.executemany(
                "INSERT INTO loss VALUES (?, ?, ?, ?, ?)",
                [(each.source, each.boot, each.from_seq, each.to_seq, each.count) for each in losses],
            )
            self.losses = tuple(losses)


def runs(ids: Collection[int]) -> Iterator[tuple[int, int]]:
    """Return the runs of neighbouring numbers, first and last of each."""
    first = last = None
    for each in sorted(ids):
        if first is not None and last is not None and each > last + 1:
            yield first, last
            first = None
        first, last = each if first is None else first, each
    if first is not None and last is not None:
        yield first, last
