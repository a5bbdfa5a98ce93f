"""The parts of docs/simulate.md: options of the verb, kinds of faults, keys of the faults file."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Iterator, Mapping
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

import click
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from docs.generate.configuration import kind_of, kinds_within, model_in
from docs.generate.markdown import plain, table
from lfs10d.cli.simulate import command
from lfs10d.schema.fields import Duration
from lfs10d.schema.quantities import duration_text
from lfs10d.simulator.fault_file import FaultEntry, LineEntry, NoiseEntry, SecondMasterEntry, SlaveEntry, WindowEntry
from lfs10d.simulator.faults import DEFAULT_DELAYS, FaultKind

HEAD = ("key", "value", "default", "meaning")
KEYS = {"length": "bytes", "value": "id"}
"""Fields of a fault in the code, and their keys in the file where those have other names."""


def parts() -> Mapping[str, str]:
    """Return the generated parts by name."""
    return {
        "options": table(("option", "default", "meaning"), _options()),
        "kinds": table(("fault", "what the sensor does"), _kinds()),
        "delays": table(("fault", "`delay` where none is given"), _delays()),
        "fault": _keys(FaultEntry),
        "slave": _keys(SlaveEntry),
        "line": _keys(LineEntry),
        "noise": _keys(NoiseEntry),
        "second_master": _keys(SecondMasterEntry),
        "window": _keys(WindowEntry),
    }


def _options() -> Iterator[tuple[str, ...]]:
    context = click.Context(command)
    for option in command.params:
        record = option.get_help_record(context)
        if record is not None:
            default = option.default if isinstance(option.default, str | int) else None
            shown = "" if default is None or isinstance(default, bool) else f"`{default}`"
            yield f"`{record[0]}`", shown, plain(str(getattr(option, "help", None) or ""))


def kinds() -> Mapping[str, str]:
    """Return what each kind of fault does, from the docstring below it; ValueError where one has none."""
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(FaultKind))).body
    assert isinstance(tree, ast.ClassDef)  # noqa: S101  # the source of a class is one class
    found: dict[str, str] = {}
    name = ""
    for statement in tree.body:
        match statement:
            case ast.Assign(targets=[ast.Name(id=member)]):
                name = FaultKind[member].value
            case ast.Expr(value=ast.Constant(value=str(words))) if name:
                found[name] = " ".join(words.split())
    missing = set(FaultKind) - found.keys()
    if missing:
        raise ValueError(f"no docstring: {', '.join(sorted(missing))}")
    return found


def _kinds() -> Iterator[tuple[str, ...]]:
    for kind, words in kinds().items():
        for field, key in KEYS.items():
            words = words.replace(f"`{field}`", f"`{key}`")  # noqa: PLW2901 - each word in turn
        yield f"`{kind}`", plain(words)


def _delays() -> Iterator[tuple[str, ...]]:
    yield from ((f"`{kind.value}`", f"`{duration_text(seconds)}`") for kind, seconds in DEFAULT_DELAYS.items())


def _keys(model: type[BaseModel]) -> str:
    """Return the table of a mapping's keys, those of its window left out; ValueError where one has no description."""
    window = WindowEntry.model_fields if issubclass(model, WindowEntry) and model is not WindowEntry else ()
    return table(HEAD, (_row(name, field) for name, field in model.model_fields.items() if name not in window))


def _row(name: str, field: FieldInfo) -> tuple[str, ...]:
    if not field.description:
        raise ValueError(f"{name} has no description")
    default = "required" if field.is_required() else _default(field)
    value = "a fault of the table above" if name == "fault" else _value(field)
    return f"`{field.alias or name}`", plain(value), default, plain(field.description)


def _value(field: FieldInfo) -> str:
    """Return what one value may be, in words."""
    if get_origin(field.annotation) is tuple and get_args(field.annotation)[0] is str:
        return "a list of names"
    inner = model_in(field.annotation)
    if inner is not None:
        return "a fault, or a list of faults" if inner is FaultEntry else "a list of mappings"
    literal = next(_literals(field.annotation), None)
    if literal is not None:
        return " or ".join(literal)
    kind = kind_of(field) or next(kinds_within(field.annotation), None)
    return "a number from 0 to 1" if kind is None else _short(kind)


def _short(kind: Any) -> str:  # noqa: ANN401 - any kind of value
    words = str(kind.words)
    return words.partition(", written as ")[0]


def _literals(annotation: Any) -> Iterator[tuple[str, ...]]:  # noqa: ANN401 - an annotation is of any type
    if get_origin(annotation) is Literal:
        yield get_args(annotation)
    elif get_origin(annotation) in {Union, UnionType}:
        for each in get_args(annotation):
            yield from _literals(each)


def _default(field: FieldInfo) -> str:
    value = field.default
    if value in (None, ()):
        return "none"
    if isinstance(kind_of(field), Duration) or "Time" in str(field.annotation):
        return f"`{duration_text(value)}`"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"
