"""A file changed, cut off or with flipped bits never holds a wrong sample."""

from __future__ import annotations

import shutil
import sqlite3
from pathlib import Path

import pytest

from lfs10d.outbox.store.row import DamagedError
from lfs10d.outbox.store.sample_file import SampleFile
from lfs10d.telemetry.publication import Sample
from tests.support.rows import BOOT, ROOMY, sample
from tests.support.sample_files import keep, kept

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
