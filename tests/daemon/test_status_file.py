"""`status.json`: never half, readable by all, no reason to fail."""

from __future__ import annotations

import json
import os
from pathlib import Path

from lfs10d.daemon.status_file import StatusFile

STATUS = {"v": 1, "line": {"name": "line0", "open": True}, "devices": [{"name": "a"}, {"name": "b"}], "none": []}


def test_what_is_shown_is_json_that_all_may_read(tmp_path: Path) -> None:
    file = StatusFile(tmp_path / "lfs10d-line0" / "status.json")
    before = os.umask(0o077)
    try:
        assert file.show(STATUS)
    finally:
        os.umask(before)

    assert json.loads(file.path.read_text()) == STATUS
    assert file.path.stat().st_mode & 0o777 == 0o644


def test_an_older_one_is_replaced_whole(tmp_path: Path) -> None:
    file = StatusFile(tmp_path / "status.json")
    file.show(STATUS)
    with file.path.open() as reader:
        file.show({"v": 2})

        assert json.loads(reader.read()) == STATUS
    assert json.loads(file.path.read_text()) == {"v": 2}
    assert [path.name for path in tmp_path.iterdir()] == ["status.json"]


def test_a_place_that_cannot_be_written_is_told_and_no_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    file = StatusFile(tmp_path / "file" / "status.json")

    assert not file.show(STATUS)
    file.remove()

    assert (tmp_path / "file").read_text() == ""


def test_nothing_is_left_behind(tmp_path: Path) -> None:
    file = StatusFile(tmp_path / "status.json")
    file.show(STATUS)

    file.remove()
    file.remove()

    assert not list(tmp_path.iterdir())
