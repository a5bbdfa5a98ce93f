"""Every file and folder that the pages for contributors name is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.generate.architecture import PACKAGE, WIDTH, floors, packages

ROOT = Path(__file__).parents[2]
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
PAGES = {"CONTRIBUTING.md": CONTRIBUTING, "docs/architecture.md": ARCHITECTURE}
DECISIONS = {page.name: page.read_text(encoding="utf-8") for page in (ROOT / "docs" / "decisions").glob("*.md")}
GONE = {"bench/engine.py"}
"""Files that a decision names as part of the history."""
TOPICS = re.compile(r"(?:line|device|config|register|request)/[a-z<>]+")
"""Names of requests and topics, which look like paths."""


def paths(text: str) -> set[str]:
    """Return what stands in backquotes and looks like a path: `line/line.py`, `tests/support/`."""
    words = re.findall(r"`([\w.]+(?:/[\w.]*)+)(?:::\w+)?`", text)
    return {word for word in words if not TOPICS.fullmatch(word)}


@pytest.mark.parametrize("name", PAGES)
def test_every_path_is_there(name: str) -> None:
    named = paths(PAGES[name])
    assert len(named) > 10
    missing = {path for path in named if not (ROOT / path).exists() and not (PACKAGE / path).exists()}
    assert missing == set()


@pytest.mark.parametrize("name", DECISIONS)
def test_every_module_that_a_decision_names_is_there(name: str) -> None:
    modules = set(re.findall(r"`([a-z_]+(?:/[a-z_0-9]+)+(?:\.py)?)`", DECISIONS[name]))
    missing = {
        each
        for each in modules - GONE
        if not any((base / f"{each}{end}").exists() for base in (ROOT, PACKAGE) for end in ("", ".py"))
    }
    assert missing == set()


def test_every_recipe_names_files_and_tests() -> None:
    recipes = re.split(r"^## ", CONTRIBUTING, flags=re.MULTILINE)[1:]
    assert [each.partition("\n")[0] for each in recipes] == [
        "A register type",
        "A fault code",
        "A request",
        "A published topic",
        "A retry rule",
        "A configuration key",
        "A CLI verb",
        "The page",
    ]
    for each in recipes:
        assert re.search(r"`lfs10d/[\w/]+\.py`", each)
        assert re.search(r"`tests/[\w/]+\.py`", each)


def test_the_picture_shows_every_package_once_from_the_top_floor_down() -> None:
    drawn = re.findall(r"│ (\w+)/ ", ARCHITECTURE)
    assert drawn == [name for floor in reversed(floors()) for name in packages(floor)]
    assert set(drawn) == {each.parent.name for each in PACKAGE.glob("*/__init__.py")}
    assert max(map(len, re.findall(r"^[┌│└].*$", ARCHITECTURE, re.MULTILINE))) <= WIDTH
