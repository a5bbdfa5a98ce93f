"""The files that wheel and source archive hold."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
REGISTRIES = ("pypi" + ".org", "python" + "hosted", "piwheels" + ".org", "npm" + "js", "docker" + ".io", "ghcr" + ".io")
"""Hosts of package registries: an installation takes the one that pip is configured for."""


def shipped() -> Iterator[Path]:
    """Yield each file of the wheel and of the source archive."""
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]
    names = {*build["sdist"]["include"], *build["wheel"]["packages"], *build["wheel"]["shared-data"]}
    for name in names:
        place = ROOT / name.lstrip("/")
        yield from (place.rglob("*") if place.is_dir() else [place])


def test_no_shipped_file_names_the_host_of_a_package_registry() -> None:
    files = [each for each in shipped() if each.is_file() and "__pycache__" not in each.parts]
    assert len(files) > 300
    found = [
        f"{each.relative_to(ROOT)}: {host}"
        for each in files
        for host in REGISTRIES
        if host.encode() in each.read_bytes()
    ]
    assert found == []


def test_every_page_of_the_documentation_is_in_the_wheel() -> None:
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]
    pages = {f"docs/{each.name}" for each in (ROOT / "docs").glob("*.md")}
    assert pages <= set(build["wheel"]["shared-data"])
