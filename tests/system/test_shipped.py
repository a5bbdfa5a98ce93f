"""Files that come with the program are found below its prefix, and in a working copy in their places."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from lfs10d.system.shipped import shipped


def test_an_installation_has_its_files_below_its_prefix(tmp_path: Path) -> None:
    file = tmp_path / "share/lfs10d/systemd/lfs10d.service"
    file.parent.mkdir(parents=True)
    file.touch()
    assert shipped("systemd/lfs10d.service", tmp_path) == file


def test_a_working_copy_has_them_in_place(tmp_path: Path) -> None:
    assert shipped("systemd/lfs10d.service", tmp_path) == Path(__file__).parents[2] / "systemd/lfs10d.service"
    assert shipped("systemd/lfs10d.service").name == "lfs10d.service"


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"systemd/other did not come .*share/lfs10d/systemd/other is missing"):
        shipped("systemd/other", tmp_path)


def test_every_page_and_every_file_that_is_installed_comes_with_the_wheel() -> None:
    root = Path(__file__).parents[2]
    wheel = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    sources = wheel["shared-data"]
    assert [page.name for page in (root / "docs").glob("*.md") if f"docs/{page.name}" not in sources] == []
    assert [source for source in sources if not (root / source).exists()] == []
    assert {"docs/decisions", "docs/integrations"} <= sources.keys()
    assert {sources["config"], sources["systemd"]} == {"share/lfs10d/config", "share/lfs10d/systemd"}
