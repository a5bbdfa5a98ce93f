"""The parts of docs/architecture.md: the floors from the contract that holds them, the exchange from its table."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

from docs.generate.markdown import plain, table
from lfs10d.modbus.exchange import TRANSITIONS, State

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "lfs10d"
FLOORS = "The floors: a package imports only from floors below"
"""The contract's name in pyproject.toml."""


def parts() -> Mapping[str, str]:
    """Return the generated parts by name."""
    return {
        "floors": table(("floor", "package", "what it is for"), _floors()),
        "exchange": "\n".join(("```mermaid", "stateDiagram-v2", *_transitions(), "```")),
    }


def floors() -> list[list[str]]:
    """Return the names of the packages on each floor, the ground floor first; what is not built yet is left out."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = project["tool"]["importlinter"]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract["name"] == FLOORS)
    names = [[name.strip(" ()") for name in re.split("[:|]", layer)] for layer in reversed(layers)]
    return [[name for name in floor if _file(name) is not None] for floor in names]


def _floors() -> Iterator[tuple[str, ...]]:
    for number, floor in reversed(list(enumerate(floors()))):
        for place, name in enumerate(floor):
            yield (str(number) if place == 0 else "", f"`{name}`", plain(_purpose(name)))


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
