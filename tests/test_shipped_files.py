"""The files that wheel and source archive hold."""

from __future__ import annotations

import ast
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


def test_the_source_archive_has_what_its_tests_import() -> None:
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]
    imported = set()
    for file in (ROOT / "tests").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                imported |= {each.name.partition(".")[0] for each in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                imported.add(node.module.partition(".")[0])
    ours = {f"/{name}" for name in imported if (ROOT / name).is_dir()}
    assert {"/bench", "/lfs10d", "/tests"} <= ours
    assert ours <= set(build["sdist"]["include"])
