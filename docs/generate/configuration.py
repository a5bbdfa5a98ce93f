"""The parts of docs/configuration.md: every key of the configuration's models."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from types import UnionType
from typing import Annotated, Any, TypeAlias, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from docs.generate.markdown import plain
from lfs10d.config.diff import RESTART_KEYS
from lfs10d.config.models import Config
from lfs10d.profiles.library import builtin_names
from lfs10d.schema.fields import Duration, FieldKind, Size
from lfs10d.schema.quantities import duration_text, size_text

Model: TypeAlias = type[BaseModel]

_HOW_TO_WRITE = ", written as "
"""Where the words of durations and sizes turn to what the page says once, at its beginning."""

_DEFAULT = " Default: "
"""Where a description turns to a default that is no constant."""


def parts() -> Mapping[str, str]:
    """Return the generated parts by name: one per section of the file, and the profiles."""
    generated = {name: "\n\n".join(_keys(Config, name, field)) for name, field in Config.model_fields.items()}
    return {**generated, "profiles": ", ".join(f"`{name}`" for name in builtin_names())}


def _keys(owner: Model, path: str, field: FieldInfo) -> Iterator[str]:
    """Yield the entry of one key, or those of all keys below it."""
    model = model_in(field.annotation)
    if model is None or _nullable(field.annotation) or _listed(field.annotation) or _named(field.annotation):
        yield _entry(owner, path, field)
    if model is not None:
        below = f"{path}[]" if _listed(field.annotation) else path
        below += ".NAME" if _named(field.annotation) else ""
        for name, inner in model.model_fields.items():
            yield from _keys(model, f"{below}.{name}", inner)


def _entry(owner: Model, path: str, field: FieldInfo) -> str:
    """Return what a person needs to know of one key; without description there is no entry."""
    if not field.description:
        raise ValueError(f"{owner.__name__}: {path} has no description")
    says, _, default = field.description.partition(_DEFAULT)
    restart = path in RESTART_KEYS
    return "\n".join(
        (
            f"### `{path}`",
            "",
            plain(says),
            "",
            f"- Value: {plain(_value(field))}.",
            "- **Required.**" if field.is_required() else f"- Default: {plain(default) or f'`{written(field)}`.'}",
            "- **Takes effect at the next restart.**" if restart else "- Reload: applied.",
        )
    )


def _value(field: FieldInfo) -> str:
    kind = kind_of(field)
    if kind is not None:
        return kind.words.partition(_HOW_TO_WRITE)[0]
    model = model_in(field.annotation)
    if model is None and field.annotation is float:
        low, high = (next(getattr(each, key) for each in field.metadata if hasattr(each, key)) for key in ("ge", "le"))
        return f"a number from {low:.10g} to {high:.10g}"
    if model is None:
        inner = next(iter(kinds_within(field.annotation)))
        return f"a list of any of {inner.words.replace(' or ', ', ')}; `[]` for none"
    if _listed(field.annotation):
        return "a list; each item a slave id, or a mapping of the keys below"
    if _named(field.annotation):
        return "a mapping of names to mappings of the keys below; `{}` for none"
    return "`null`, or a mapping of the keys below"


def written(field: FieldInfo) -> str:
    """Return the default as it is written in YAML."""
    value, kind = field.default, kind_of(field)
    if isinstance(kind, Duration):
        return "auto" if value is None else duration_text(value)
    if isinstance(kind, Size):
        return size_text(value)
    if isinstance(value, tuple):
        return f"[{', '.join(value)}]"
    return value if isinstance(value, str) else json.dumps(value)


def kind_of(field: FieldInfo) -> FieldKind | None:
    """Return what one value may be; None for sections and lists."""
    return next((each for each in field.metadata if isinstance(each, FieldKind)), None)


def model_in(annotation: Any) -> Model | None:  # noqa: ANN401  # any annotation
    """Return the model that an annotation is, or has within a list or beside null."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(model_in, get_args(annotation))), None)


def kinds_within(annotation: Any) -> Iterator[FieldKind]:  # noqa: ANN401 - an annotation is of any type
    """Yield what single values within an annotation may be."""
    if get_origin(annotation) is Annotated:
        yield from (each for each in get_args(annotation)[1:] if isinstance(each, FieldKind))
    for inner in get_args(annotation):
        yield from kinds_within(inner)


def _nullable(annotation: Any) -> bool:  # noqa: ANN401 - an annotation is of any type
    return get_origin(annotation) in {Union, UnionType} and type(None) in get_args(annotation)


def _named(annotation: Any) -> bool:  # noqa: ANN401 - an annotation is of any type
    return get_origin(annotation) is dict


def _listed(annotation: Any) -> bool:  # noqa: ANN401 - an annotation is of any type
    return get_origin(annotation) is tuple
