"""What the doctor says of clock, disk, service and daemons."""

from __future__ import annotations

import errno
import os
from dataclasses import replace
from pathlib import Path

import pytest

from lfs10d.cli.doctor.finding import Finding
from lfs10d.cli.doctor.host import DiskState, clock, daemons, disk, look_at_disk, service
from lfs10d.cli.doctor.port import Root
from lfs10d.system.clock_step import ClockState

INSTALLED = 1.8e9
GOOD_DISK = DiskState(Path("/var/lib/lfs10d"), "mmcblk0p2", exists=True, writable=True, free=10**10, wanted=10**8)
GOOD_UNIT = {
    "LoadState": "loaded", "UnitFileState": "enabled", "ActiveState": "active", "NRestarts": "0", "Result": "success",
    "ExecMainStatus": "0", "WatchdogUSec": "30s", "MainPID": "7",
}  # fmt: skip


def only(found: list[Finding]) -> Finding:
    """Return the one finding that has advice."""
    (bad,) = [each for each in found if each.advice]
    return bad


@pytest.mark.parametrize(
    ("state", "now", "level", "text"),
    [
        ("unsynced", INSTALLED, "warn", "not synchronised"),
        ("unknown", INSTALLED, "warn", "it is not known"),
        ("synced", INSTALLED - 4e7, "fail", "before this version was installed"),
    ],
)
def test_a_clock_that_is_off_is_named(state: ClockState, now: float, level: str, text: str) -> None:
    found = only(list(clock(state, now, INSTALLED)))
    assert found.level == level
    assert text in found.text


def test_a_synchronised_clock_is_well() -> None:
    assert [each.level for each in clock("synced", INSTALLED + 1, INSTALLED)] == ["ok"]


@pytest.mark.parametrize(
    ("state", "level", "text"),
    [
        (replace(GOOD_DISK, sync=0.5), "warn", "a write takes 0.5 s"),
        (replace(GOOD_DISK, sync=3.0), "fail", "a write takes 3.0 s"),
        (replace(GOOD_DISK, free=10**6), "warn", "1 MB are free"),
        (replace(GOOD_DISK, writable=False), "warn", "cannot be written by this user"),
        (replace(GOOD_DISK, written=50e9), "warn", "50 GB a day"),
        (replace(GOOD_DISK, refused=errno.ENOSPC), "fail", "cannot be written: no space left on device"),
        (replace(GOOD_DISK, writable=False, refused=errno.EROFS), "fail", "cannot be written: read-only file system"),
        (replace(GOOD_DISK, refused=errno.EIO), "fail", "cannot be written: input/output error"),
    ],
)
def test_a_disk_in_trouble_is_named(state: DiskState, level: str, text: str) -> None:
    found = only(list(disk(state)))
    assert found.level == level
    assert text in found.text


def test_a_good_disk_is_well() -> None:
    assert [each.level for each in disk(replace(GOOD_DISK, sync=0.004, written=1e9))] == ["ok"]
    assert [each.level for each in disk(replace(GOOD_DISK, exists=False, writable=False))] == ["ok"]
    assert [each.level for each in disk(replace(GOOD_DISK, device="sda1", written=50e9))] == ["ok"]


def test_a_directory_is_tried_and_nothing_is_left_there(tmp_path: Path) -> None:
    seen = look_at_disk(tmp_path, 1000, Root(tmp_path / "none"))
    assert seen.writable
    assert seen.sync is not None
    assert list(tmp_path.iterdir()) == []
    absent = look_at_disk(tmp_path / "not/yet", 1000, Root(tmp_path / "none"))
    assert (absent.exists, absent.writable, absent.sync, absent.written) == (False, False, None, None)
    assert absent.free > 0


def test_a_folder_that_one_may_not_look_into_is_no_trouble(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a person without sudo finds the state of a service with DynamicUser: a link into a closed folder."""
    link = tmp_path / "lfs10d"
    link.symlink_to(tmp_path / "private/lfs10d")
    stat = Path.stat

    def closed(path: Path, *, follow_symlinks: bool = True) -> os.stat_result:
        if path == link and follow_symlinks:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return stat(path, follow_symlinks=follow_symlinks)

    monkeypatch.setattr(Path, "stat", closed)
    seen = look_at_disk(link, 1000, Root(tmp_path / "none"))
    assert (seen.exists, seen.writable, seen.sync, seen.refused) == (True, False, None, 0)
    assert "cannot be written by this user" in only(list(disk(seen))).text


def test_a_disk_that_refuses_a_write_is_not_told_to_be_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a full one does: the folder has the right mode, and a write fails."""

    def full(descriptor: int, data: bytes) -> int:
        raise OSError(errno.ENOSPC, f"{descriptor} {len(data)}")

    monkeypatch.setattr(os, "write", full)
    seen = look_at_disk(tmp_path, 1000, Root(tmp_path / "none"))
    assert (seen.writable, seen.sync, seen.refused) == (True, None, errno.ENOSPC)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "level", "text"),
    [
        ({"LoadState": "not-found"}, "warn", "is not installed"),
        ({"ActiveState": "inactive"}, "fail", "does not run"),
        ({"ActiveState": "failed", "Result": "watchdog"}, "fail", "failed (watchdog)"),
        ({"ActiveState": "failed", "ExecMainStatus": "78", "Result": "exit-code"}, "fail", "configuration is wrong"),
        ({"UnitFileState": "disabled"}, "warn", "not started at boot"),
        ({"NRestarts": "3", "Result": "watchdog"}, "warn", "restarted 3 times (watchdog)"),
        ({"WatchdogUSec": "infinity"}, "warn", "has no watchdog"),
    ],
)
def test_a_service_in_trouble_is_named(change: dict[str, str], level: str, text: str) -> None:
    found = only(list(service("lfs10d.service", GOOD_UNIT | change)))
    assert found.level == level
    assert text in found.text


def test_a_running_service_is_well_and_no_systemd_is_said() -> None:
    assert [each.level for each in service("lfs10d.service", GOOD_UNIT)] == ["ok"]
    assert "no systemd" in only(list(service("lfs10d.service", None))).text


def test_a_second_daemon_is_named() -> None:
    assert list(daemons((4,))) == list(daemons(())) == []
    assert "2 daemons run for this line (processes 4, 5)" in only(list(daemons((4, 5)))).text
