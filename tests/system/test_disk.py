"""Files that survive a power cut, proved with files that forget what was not synced."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.system.disk import Disk
from tests.support.volatile_disk import ForgetfulFiles, PowerCutError

FILE = Path("/state/changes.yaml")
DRAFT = Path("/state/.changes.yaml.new")
STEPS_OF_REPLACE = 4


def begun() -> tuple[ForgetfulFiles, Disk]:
    """Return files with an old content safely on the disk."""
    files = ForgetfulFiles()
    disk = Disk(files)
    disk.replace(FILE, b"old")
    return files, disk


@given(st.integers(0, STEPS_OF_REPLACE), st.sets(st.sampled_from([FILE, DRAFT])))
def test_a_replaced_file_is_old_or_new_whenever_the_power_fails(cut: int, surviving: set[Path]) -> None:
    files, disk = begun()
    files.steps_left = files.steps + cut
    try:
        disk.replace(FILE, b"new")
        returned = True
    except PowerCutError:
        returned = False
    files.power_cut(surviving)
    assert returned == (cut == STEPS_OF_REPLACE)
    assert disk.read(FILE) in ({b"new"} if returned else {b"old", b"new"})


def test_a_removed_file_stays_removed() -> None:
    files, disk = begun()
    disk.remove(FILE)
    disk.remove(FILE)
    files.power_cut()
    assert not files.exists(FILE)


def test_a_full_disk_leaves_the_old_content_and_no_draft() -> None:
    files, disk = begun()
    files.full = 2
    with pytest.raises(OSError, match="No space left") as failed:
        disk.replace(FILE, b"new content")
    assert failed.value.errno == errno.ENOSPC
    assert disk.read(FILE) == b"old"
    assert set(files.seen) == {FILE}


def test_on_the_real_file_system_the_same_steps_do_the_same(tmp_path: Path) -> None:
    disk, file = Disk(), tmp_path / "file"
    disk.replace(file, b"one")
    disk.replace(file, b"two")
    assert disk.read(file) == b"two"
    assert file.stat().st_mode & 0o777 == 0o600
    disk.replace(tmp_path / "new", b"x")
    disk.remove(file)
    assert [path.name for path in tmp_path.iterdir()] == ["new"]


def test_a_folder_that_is_not_there_is_an_error_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        Disk().replace(tmp_path / "none" / "file", b"x")


@pytest.mark.parametrize("cut", range(3))
def test_a_file_put_aside_is_under_one_of_its_names_whenever_the_power_fails(cut: int) -> None:
    files, disk = begun()
    aside = FILE.with_name("aside")
    files.steps_left = files.steps + cut
    if cut < 2:
        with pytest.raises(PowerCutError):
            disk.put_aside(FILE, aside)
    else:
        disk.put_aside(FILE, aside)
    files.power_cut()
    assert files.read(aside if cut == 2 else FILE) == b"old"
    assert files.exists(aside) is not files.exists(FILE)
