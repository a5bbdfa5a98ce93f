"""The house as `docs/architecture.md` shows it: few packages, short modules, one name for one class."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "lfs10d"
PACKAGES = {
    "cli", "daemon", "commands", "reconfiguration", "line", "mqtt", "simulator", "outbox", "config", "profiles",
    "modbus", "telemetry", "schema", "system", "web",
}  # fmt: skip
MODULES = {"__init__", "__main__", "errors", "reading", "command"}
LONGEST_MODULE = 320
"""Lines."""


def test_the_listing_shows_fifteen_packages_and_five_files() -> None:
    folders = {each.name for each in PACKAGE.iterdir() if each.is_dir() and each.name != "__pycache__"}
    assert folders == PACKAGES
    assert {each.stem for each in PACKAGE.glob("*.py")} == MODULES


def test_no_module_is_long() -> None:
    files = [*PACKAGE.rglob("*.py"), *Path(__file__).parent.rglob("*.py")]
    lines = {str(each.relative_to(PACKAGE.parent)): len(each.read_text().splitlines()) for each in files}
    assert {name: count for name, count in lines.items() if count > LONGEST_MODULE} == {}


def test_each_class_name_is_defined_once() -> None:
    places: defaultdict[str, list[str]] = defaultdict(list)
    for file in PACKAGE.rglob("*.py"):
        for node in ast.parse(file.read_text()).body:
            if isinstance(node, ast.ClassDef):
                places[node.name].append(str(file.relative_to(PACKAGE)))
    assert {name: files for name, files in places.items() if len(files) > 1} == {}


def test_each_package_says_its_job_in_one_line() -> None:
    for folder in [PACKAGE / name for name in PACKAGES]:
        tree = ast.parse((folder / "__init__.py").read_text())
        docstring = ast.get_docstring(tree)
        assert docstring, folder.name
        assert folder.name == "cli" or len(tree.body) == 1, f"{folder.name}/__init__.py holds code"


def test_the_index_of_the_rigs_names_each_module_once() -> None:
    folder = Path(__file__).parent / "support"
    index = ast.get_docstring(ast.parse((folder / "__init__.py").read_text())) or ""
    named = re.findall(r"^ {4}`(\w+)`  +\S", index, flags=re.MULTILINE)
    modules = {each.stem for each in folder.glob("*.py") if not each.name.startswith(("__init__", "test_"))}
    assert sorted(named) == sorted(modules)
