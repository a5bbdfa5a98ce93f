"""The pages of docs/integrations: short, listed, and each says what was run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "integrations"
INDEX = (FOLDER / "index.md").read_text(encoding="utf-8")
PAGES = sorted(each for each in FOLDER.glob("*.md") if each.name != "index.md")
SCREEN = 45
"""Lines of a page at most."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_is_at_most_a_screen_and_says_what_was_run(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= SCREEN
    last = text.strip().split("\n\n")[-1]
    said = re.match(r"\*\*(Run|Not run|Checked, not run)\*\*", last)
    assert said, last
    assert said[1] != "Run" or re.search(r"with [\w\- ]+ \d+\.\d+", last), "no version"
    (row,) = re.findall(rf"^\| \[{page.name}\]\({page.name}\) \| .* \| (.*) \|$", INDEX, re.MULTILINE)
    assert row.startswith("yes") == (said[1] == "Run")


def test_every_file_of_the_recipes_is_named_by_a_page() -> None:
    named = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    files = {each.name for each in (ROOT / "config" / "integrations").iterdir()} - {"__pycache__"}
    assert {name for name in files if name not in named} == set()
