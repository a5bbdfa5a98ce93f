"""The JSON Schema of lfs10d.yaml (draft 2020-12), for editors.

It states what each key may hold. The rules between keys, and whether files and profiles exist, are left to
`lfs10d check`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from lfs10d.config.models import Config
from lfs10d.schema.fields import Duration, Size
from lfs10d.schema.messages import models_in
from lfs10d.schema.quantities import duration_text, size_text

DRAFT = "https://json-schema.org/draft/2020-12/schema"

COMPUTED = "Default: "
"""Begins the default in a description, for a default that is no constant."""


def json_schema() -> dict[str, Any]:
    """Return the schema as JSON data; defaults are written as in YAML."""
    schema = Config.model_json_schema()
    models: set[type[BaseModel]] = {Config, *_sections(Config)}
    for model in models:
        section = schema if model is Config else schema["$defs"][model.__name__]
        del section["title"]
        for name, field in model.model_fields.items():
            entry = section["properties"][name]
            for key in ("title", "default"):
                entry.pop(key, None)
            entry.update(description=field.description, **_default(field))
    return {"$schema": DRAFT, "title": "lfs10d.yaml", **schema, "description": "The configuration of lfs10d."}


def _sections(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    for field in model.model_fields.values():
        for section in models_in(field.annotation):
            yield section
            yield from _sections(section)


def _default(field: FieldInfo) -> dict[str, Any]:
    """Return the default of a key; nothing for a required key, a section or a computed default."""
    value = field.default
    if field.is_required() or isinstance(value, BaseModel) or COMPUTED in (field.description or ""):
        return {}
    kind = next((each for each in field.metadata if isinstance(each, Duration | Size)), None)
    if isinstance(kind, Duration):
        value = "auto" if value is None else duration_text(value)
    elif isinstance(kind, Size):
        value = size_text(value)
    return {"default": list(value) if isinstance(value, tuple) else value}
