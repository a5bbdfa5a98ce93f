"""What samples have in common is kept once, corrected once, and believed only if it is what was written."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from lfs10d.outbox.store.catalogue import Catalogue
from lfs10d.outbox.store.database import connect, transaction
from lfs10d.outbox.store.row import DamagedError
from tests.support.rows import BOOT, ROOMY, START, sample


def test_an_era_ends_where_the_clock_is_set_and_a_series_where_anything_differs(tmp_path: Path) -> None:
    with closing(connect(tmp_path / "f.db", boot=BOOT, limits=ROOMY)) as db:
        catalogue = Catalogue(db, boot=BOOT)
        with transaction(db):
            first = catalogue.place(sample(1), START, repeated=False)
            assert catalogue.place(sample(2), START + 20, repeated=False) == first
            places = [
                catalogue.place(sample(3), START + 21, repeated=False),
                catalogue.place(sample(3, "b"), START + 21, repeated=False),
                catalogue.place(sample(4, clock="unsynced"), START + 21, repeated=False),
                catalogue.place(sample(4, clock="unsynced"), START + 21, repeated=True),
                catalogue.place(sample(5, error="crc", clock="unsynced"), START + 21, repeated=False),
            ]
        assert len({key for key, _, _ in (first, *places)}) == 6
        assert [base for _, _, base in places] == [START + 1000 * seq for seq in (3, 3, 4, 4, 4)]
        again = Catalogue(db, boot=BOOT)
        assert [again.find(key) for key, _, _ in (first, *places)] == [
            catalogue.find(key) for key, _, _ in (first, *places)
        ]


def test_only_eras_of_this_boot_are_corrected_and_only_once(tmp_path: Path) -> None:
    with closing(connect(tmp_path / "f.db", boot=BOOT, limits=ROOMY)) as db:
        catalogue = Catalogue(db, boot=BOOT)
        with transaction(db):
            earlier, _, _ = catalogue.place(sample(1, boot="k0000001", clock="unsynced", ts=7), 0, repeated=False)
            ours, _, _ = catalogue.place(sample(1, clock="unsynced", ts=7), 0, repeated=False)
            for shift in (START, START + 999):
                catalogue.correct(shift)
        for each in (catalogue, Catalogue(db, boot=BOOT)):
            assert (each.find(earlier)[0].base, each.find(earlier)[0].clock) == (7, "unsynced")
            assert (each.find(ours)[0].base, each.find(ours)[0].clock) == (START + 7, "synced")


def test_a_clock_that_was_set_corrects_what_was_measured_before_and_marks_it(tmp_path: Path) -> None:
    with closing(connect(tmp_path / "f.db", boot=BOOT, limits=ROOMY)) as db:
        catalogue = Catalogue(db, boot=BOOT)
        with transaction(db):
            before, _, _ = catalogue.place(sample(1, clock="unknown", ts=7), 0, repeated=False)
            synced, _, _ = catalogue.place(sample(2, clock="synced", ts=8), 1, repeated=False)
            after, _, _ = catalogue.place(sample(3, clock="unknown", ts=START + 9), START, repeated=False)
            catalogue.correct(START + 1, "unsynced")
        for each in (catalogue, Catalogue(db, boot=BOOT)):
            eras = [each.find(key)[0] for key in (before, synced, after)]
            assert [(era.base, era.clock) for era in eras] == [
                (START + 8, "unsynced"),
                (8, "synced"),
                (START + 9, "unknown"),
            ]


def test_what_is_cleared_is_made_anew(tmp_path: Path) -> None:
    with closing(connect(tmp_path / "f.db", boot=BOOT, limits=ROOMY)) as db:
        catalogue = Catalogue(db, boot=BOOT)
        with transaction(db):
            catalogue.place(sample(1), START, repeated=False)
            catalogue.clear()
        with pytest.raises(DamagedError):
            catalogue.find(1)
        with transaction(db):
            key, _, base = catalogue.place(sample(9), START, repeated=False)
        assert (key, base) == (1, START + 9000)


@pytest.mark.parametrize(
    "statement",
    ["UPDATE era SET base = base + 1", "UPDATE series SET era = 99", "UPDATE series SET facts = '[]'"],
)
def test_an_era_or_a_series_that_was_changed_is_found_at_once(tmp_path: Path, statement: str) -> None:
    with closing(connect(tmp_path / "f.db", boot=BOOT, limits=ROOMY)) as db:
        with transaction(db):
            Catalogue(db, boot=BOOT).place(sample(1), START, repeated=False)
        db.execute(statement)
        with pytest.raises(DamagedError):
            Catalogue(db, boot=BOOT)
