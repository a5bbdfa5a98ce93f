"""docs/architecture.md, README and Makefile keep what they promise. That the page is not stale: test_docs_generated."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from lfs10d.config.loader import load
from lfs10d.modbus.exchange import TRANSITIONS

ROOT = Path(__file__).parents[2]
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
TESTS = sorted(set(re.findall(r"`(tests/[\w/]+\.py)::(test_\w+)`", ARCHITECTURE)))


def test_the_picture_of_the_exchange_has_every_transition() -> None:
    drawn = re.findall(r"^    (\w+) --> (\w+): (\w+)$", ARCHITECTURE, re.MULTILINE)
    assert set(drawn) == {(before, after, why) for (before, why), after in TRANSITIONS.items()}


@pytest.mark.parametrize(("file", "test"), TESTS)
def test_each_test_that_proves_an_invariant_is_there(file: str, test: str) -> None:
    assert re.search(rf"^(?:async )?def {test}\(", (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE)


def test_every_invariant_names_a_test() -> None:
    section = ARCHITECTURE.partition("## Three invariants")[2].partition("\n## ")[0]
    invariants = re.split(r"^\*\*\d\. ", section, flags=re.MULTILINE)[1:]
    assert len(invariants) == 3
    assert all("::test_" in invariant for invariant in invariants)


def test_the_smallest_configuration_of_the_readme_is_accepted(tmp_path: Path) -> None:
    (smallest,) = re.findall(r"^```yaml\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
    file = tmp_path / "lfs10d.yaml"
    file.write_text(smallest)
    assert load(file).config.line.name == "line0"


def test_make_knows_every_target_of_the_readme() -> None:
    wanted = set(re.findall(r"\bmake (\w+)", README))
    assert {"demo", "test", "check", "bench"} <= wanted
    assert wanted <= set(re.findall(r"^(\w+):", MAKEFILE, re.MULTILINE))


@pytest.mark.needs("make")
def test_make_alone_lists_every_target_with_one_line() -> None:
    command = ["make", "--no-print-directory"]  # the tests themselves may run below make
    printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60).stdout
    (phony,) = re.findall(r"^\.PHONY: (.*)$", MAKEFILE, re.MULTILINE)
    assert re.findall(r"^  make ([\w-]+) +\S.*$", printed, re.MULTILINE) == phony.split()
    assert len(printed.splitlines()) == len(phony.split())
