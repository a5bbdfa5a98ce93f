"""The tables that many samples of a store share: eras of the clock, and series.

An era is one stretch of one boot in which wall and monotonic clock kept their distance, under one word about the
clock. A sample's `ts` is counted from its era's base, so that setting the clock right corrects one row.
"""

from __future__ import annotations

import sqlite3
from dataclasses import replace

from lfs10d.outbox.store.row import DamagedError, Series, check
from lfs10d.system.clock_step import ClockState, corrects
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import Sample

EVEN_WITHIN = 20
"""ms by which the distance of wall and monotonic clock may differ within one era: more is a step."""


@dataclass(frozen=True, slots=True)
class Era:
    """`base` is what `ts` is counted from, `shift` the wall clock less the monotonic one, both in ms."""

    boot: str
    clock: ClockState
    base: int
    shift: int

    @property
    def check(self) -> int:
        """The check over all of it."""
        return check(self.boot, self.clock, self.base, self.shift)


class Catalogue:
    """The eras and series of the file behind `db`; raises sqlite3.Error, and DamagedError when it is read."""

    def __init__(self, db: sqlite3.Connection, *, boot: str) -> None:
        self._db = db
        self._boot = boot
        self._eras: dict[int, Era] = {}
        self._series: dict[int, tuple[int, Series]] = {}
        self._ids: dict[tuple[int, Series], int] = {}
        self._now: int | None = None
        for key, checked, *facts in db.execute("SELECT id, checked, boot, clock, base, shift FROM era"):
            era = Era(*facts)
            if era.check != checked:
                raise DamagedError("an era is not what was written")
            self._eras[key] = era
        for key, era_id, text in db.execute("SELECT id, era, facts FROM series"):
            if era_id not in self._eras:
                raise DamagedError("a series has no era")
            self._series[key] = (era_id, Series.parse(text))

    def place(self, sample: Sample, shift: int, *, repeated: bool) -> tuple[int, Series, int]:
        """Return the id of the series a sample belongs to, the series, and the base of its era; made if new."""
        era = None if self._now is None else self._eras[self._now]
        even = era is not None and abs(era.shift - shift) <= EVEN_WITHIN
        if self._now is None or era is None or not even or (era.boot, era.clock) != (sample.boot, sample.clock):
            era = Era(sample.boot, sample.clock, sample.ts, shift)
            self._now = 1 + max(self._eras, default=0)
            self._eras[self._now] = era
            facts = (self._now, era.boot, era.clock, era.base, era.shift, era.check)
            self._db.execute("INSERT INTO era VALUES (?, ?, ?, ?, ?, ?)", facts)
        place = (self._now, Series.of(sample, repeated=repeated))
        key = self._ids.get(place)
        if key is None:
            key = 1 + max(self._series, default=0)
            self._series[key] = place
            self._ids[place] = key
            self._db.execute("INSERT INTO series VALUES (?, ?, ?)", (key, self._now, place[1].text))
        return key, place[1], era.base

    def find(self, key: int) -> tuple[Era, Series]:
        """Return a series and its era; raises DamagedError where there is none."""
        if key not in self._series:
            raise DamagedError("a sample has no series")
        era_id, series = self._series[key]
        return self._eras[era_id], series

    def correct(self, shift: int, clock: ClockState = "synced") -> None:
        """Give the samples of this boot the time that the clock tells now, whose word is `clock`.

        Those that were measured while it was synchronised stay; and where nobody vouches for the clock now, all but
        those from before a step.
        """
        for key, era in self._eras.items():
            if era.boot == self._boot and corrects(era.clock, era.shift, shift, clock):
                right = replace(era, base=era.base + shift - era.shift, clock=clock, shift=shift)
                self._eras[key] = right
                self._db.execute(
                    "UPDATE era SET base = ?, clock = ?, shift = ?, checked = ? WHERE id = ?",
                    (right.base, right.clock, right.shift, right.check, key),
                )

    def clear(self) -> None:
        """Forget all: there is no sample left."""
        self._db.execute("DELETE FROM series")
        self._db.execute("DELETE FROM era")
        self._eras.clear()
        self._series.clear()
        self._ids.clear()
        self._now = None
