"""The parts of docs/architecture.md: the packages from the contract on imports, the exchange from its table."""

from __future__ import annotations

import ast
import re
import textwrap
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

from lfs10d.modbus.exchange import TRANSITIONS, State

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "lfs10d"
FLOORS = "The floors: a package imports only from floors below"
"""The contract's name in pyproject.toml."""


WIDTH = 100
"""Columns of the picture."""


def parts() -> Mapping[str, str]:
    """Return the generated parts by name."""
    modules = (f"`{name}.py`" for floor in floors() for name in floor if not _is_package(name) and name != "__main__")
    return {
        "picture": "\n".join(("```text", *_picture(), "```")),
        "modules": ", ".join(modules),
        "exchange": "\n".join(("```mermaid", "stateDiagram-v2", *_transitions(), "```")),
    }


def floors() -> list[list[str]]:
    """Return the names of the packages on each floor, the ground floor first; what is not built yet is left out."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = project["tool"]["importlinter"]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract["name"] == FLOORS)
    names = [[name.strip(" ()") for name in re.split("[:|]", layer)] for layer in reversed(layers)]
    return [[name for name in floor if _file(name) is not None] for floor in names]


def _picture() -> Iterator[str]:
    """Yield the packages as boxes, floor by floor from the top."""
    for floor in reversed(floors()):
        names = packages(floor)
        boxes = [_box(name, WIDTH // len(names) - 1) for name in names]
        height = max(map(len, boxes), default=0)
        lines = [box[:-1] + [f"│{' ' * (len(box[0]) - 2)}│"] * (height - len(box)) + box[-1:] for box in boxes]
        yield from (" ".join(parts) for parts in zip(*lines, strict=True))


def _box(name: str, width: int) -> list[str]:
    inner = width - 4
    text = textwrap.wrap(_purpose(name), inner)
    lines = [f"│ {line:<{inner}} │" for line in (f"{name}/", *text)]
    return [f"┌{'─' * (width - 2)}┐", *lines, f"└{'─' * (width - 2)}┘"]


def packages(floor: list[str]) -> list[str]:
    """Return the packages of a floor, without single modules."""
    return [name for name in floor if _is_package(name)]


def _is_package(name: str) -> bool:
    return (PACKAGE / name / "__init__.py").exists()


def _purpose(name: str) -> str:
    """Return the first line of a module's docstring."""
    file = _file(name)
    docstring = file and ast.get_docstring(ast.parse(file.read_text(encoding="utf-8")))
    if not docstring:
        raise ValueError(f"lfs10d.{name} does not say what it is for")
    return docstring.partition("\n")[0]


def _file(name: str) -> Path | None:
    candidates = (PACKAGE / f"{name}.py", PACKAGE / name / "__init__.py")
    return next((file for file in candidates if file.exists()), None)


def _transitions() -> Iterator[str]:
    yield f"    [*] --> {State.SILENCE}"
    for (state, happening), following in TRANSITIONS.items():
        yield f"    {state} --> {following}: {happening}"
    yield f"    {State.SETTLED} --> [*]"
