"""Every link of an installed page leads to an installed file, beside it as in the repository."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path, PurePosixPath

import pytest

from tests.docs.test_docs_links import ROOT, links

DOCUMENTATION = PurePosixPath("share/doc/lfs10d")
SOURCES = "lfs10d/"
"""Modules that docs/architecture.md names: they are installed, where Python has its packages."""


def installed() -> dict[PurePosixPath, Path]:
    """Return each file of the wheel's documentation by its place below it, folders included."""
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    found: dict[PurePosixPath, Path] = {}
    for source, target in wheel["shared-data"].items():
        place, file = PurePosixPath(target), ROOT / source
        if place.is_relative_to(DOCUMENTATION):
            below = place.relative_to(DOCUMENTATION)
            files = file.rglob("*") if file.is_dir() else ()
            found |= {below / each.relative_to(file).as_posix(): each for each in files} | {below: file}
            found |= {parent: ROOT / parent for parent in below.parents}
    return found


INSTALLED = installed()
PAGES = sorted(str(place) for place in INSTALLED if place.suffix == ".md")


@pytest.mark.parametrize("page", PAGES)
def test_every_link_of_an_installed_page_leads_to_an_installed_file(page: str) -> None:
    targets = [
        os.path.normpath(Path(page).parent / link.partition("#")[0])
        for link in links(INSTALLED[PurePosixPath(page)])
        if not link.startswith("#")
    ]
    wanted = [each for each in targets if not (page == "docs/architecture.md" and each.startswith(SOURCES))]
    assert [each for each in wanted if PurePosixPath(each) not in INSTALLED] == []


def test_an_installed_file_lies_where_the_repository_has_it() -> None:
    assert {place: file for place, file in INSTALLED.items() if ROOT / place != file} == {}
    assert {"docs/integrations/index.md", "config/integrations/weewx", "README.md"} <= set(map(str, INSTALLED))
