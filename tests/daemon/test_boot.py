"""The id of one life of the daemon."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.daemon.boot import Boot, begin, keep
from lfs10d.system.disk import Disk
from tests.support.volatile_disk import ForgetfulFiles

FOLDER = Path("/state")
NOW = 1_795_298_022.0


class ReadOnly(ForgetfulFiles):
    """A file system on which nothing can be written."""

    def write(self, path: Path, data: bytes, *, mode: int) -> None:
        del data, mode
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))


@given(st.lists(st.floats(0, 10**10) | st.just(NOW), min_size=2, max_size=6))
def test_ids_sort_by_start_whatever_the_clock_says(starts: list[float]) -> None:
    disk = Disk(ForgetfulFiles())
    boots = [begin(FOLDER, disk, wall) for wall in starts]
    ids = [boot.id for boot in boots]
    assert ids == sorted(set(ids))
    assert [boot.previous for boot in boots] == [None, *ids[:-1]]
    assert all(boot.kept and len(boot.id) == 8 and boot.id.isalnum() for boot in boots)


def test_without_its_counter_the_clock_makes_the_ids_sort() -> None:
    first, second = (begin(FOLDER, Disk(ForgetfulFiles()), wall) for wall in (NOW, NOW + 1))
    assert first.id < second.id
    assert second.previous is None


def test_a_state_directory_that_cannot_be_written_stops_nothing() -> None:
    assert begin(FOLDER, Disk(ReadOnly()), NOW) == Boot("2ah3epy0", None, kept=False)


@pytest.mark.parametrize("content", [b"", b"nonsense!", b"ABCDEFGH", b"00000001\n\n", "äöüß".encode()])
def test_a_torn_or_foreign_counter_is_as_good_as_none(content: bytes) -> None:
    files = ForgetfulFiles()
    files.write(FOLDER / "boot", content, mode=0o600)
    boot = begin(FOLDER, Disk(files), NOW)
    assert boot.previous is None
    assert begin(FOLDER, Disk(files), NOW).previous == boot.id


def test_a_clock_before_1970_is_no_reason_to_fail() -> None:
    assert begin(FOLDER, Disk(ForgetfulFiles()), -5.0).id == "00000000"


def test_the_id_is_on_the_disk_when_the_life_begins() -> None:
    files = ForgetfulFiles()
    boot = begin(FOLDER, Disk(files), NOW)
    files.power_cut()
    assert begin(FOLDER, Disk(files), 0.0).previous == boot.id


def test_an_id_that_could_not_be_kept_is_kept_when_the_disk_can_be_written() -> None:
    life = begin(FOLDER, Disk(ReadOnly()), NOW)
    assert keep(life, FOLDER, Disk(ReadOnly())) == life
    files = ForgetfulFiles()
    assert keep(life, FOLDER, Disk(files)) == Boot(life.id, None, kept=True)
    assert begin(FOLDER, Disk(files), 0.0).previous == life.id
