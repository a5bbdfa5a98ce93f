"""The errors that pydantic finds, as messages for the person who wrote the file."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from lfs10d.schema.fields import PLAIN_ERROR, shown

KeyPath: TypeAlias = tuple[str | int, ...]
"""The path of a value: keys of mappings and indexes of lists."""


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that is nearest, None if none is near."""
    from difflib import get_close_matches  # noqa: PLC0415  # only where something is misspelled

    return next(iter(get_close_matches(word, list(known), n=1)), None)


def unknown_key(key: str, known: tuple[str, ...]) -> str:
    """Return the message for an unknown key."""
    near = nearest(key, known)
    if near:
        return f"is not a known key; did you mean {near}?"
    return f"is not a known key; known here: {', '.join(known)}" if known else "is not a known key"


def missing(model: type[BaseModel] | None, path: KeyPath) -> str:
    """Return the message for a missing key; with the model it says what to write."""
    for found in _models_at(model, path[:-1]) if model else ():
        known = found.model_fields.get(str(path[-1]))
        if known is not None and (description := known.description):
            return f"is missing; write here: {description[0].lower()}{description[1:].rstrip('.')}"
    return "is missing"


def keys_at(model: type[BaseModel], path: KeyPath) -> tuple[str, ...]:
    """Return the keys that a mapping at this path may have."""
    return tuple(field.alias or name for found in _models_at(model, path) for name, field in found.model_fields.items())


def _models_at(model: type[BaseModel], path: KeyPath) -> list[type[BaseModel]]:
    """Return the models whose keys may stand in the mapping at this path."""
    models, named = [model], False
    for step in path:
        if named:
            named = False  # a name that a person chose, in a mapping of models
        elif isinstance(step, str):
            fields = [outer.model_fields[step].annotation for outer in models if step in outer.model_fields]
            models = [inner for annotation in fields for inner in models_in(annotation)]
            named = any(get_origin(annotation) is dict for annotation in fields)
    return [] if named else models


def models_in(annotation: object) -> list[type[BaseModel]]:
    """Return the models that an annotation is or holds."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for argument in get_args(annotation) for model in models_in(argument)]


_WORDS = {
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "finite_number": "a finite number",
    "bool_type": "true or false",
    "string_type": "text",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a mapping of keys to values",
    "model_type": "a mapping of keys to values",
    "model_attributes_type": "a mapping of keys to values",
    "none_required": "null",
    "greater_than": "more than {gt}",
    "greater_than_equal": "at least {ge}",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "literal_error": "one of {expected}",
    "enum": "one of {expected}",
    "string_pattern_mismatch": "text that fits {pattern}",
    "string_too_short": "text of at least {min_length} characters",
    "string_too_long": "text of at most {max_length} characters",
    "too_short": "at least {min_length} items long",
    "too_long": "at most {max_length} items long",
}


def in_words(detail: ErrorDetails) -> str:
    """Return the message for any other error."""
    context = detail.get("ctx", {})
    if detail["type"] in _WORDS:
        wanted = _WORDS[detail["type"]].format_map(context)
        return f"must be {wanted}, not {shown(detail['input'])}"
    if detail["type"] == PLAIN_ERROR:
        return detail["msg"]
    # A validator's own ValueError carries the message; anything else pydantic words well enough.
    text = str(context.get("error", detail["msg"]))
    return " ".join(text.split())
