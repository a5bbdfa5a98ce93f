"""A validator for the part of JSON Schema (draft 2020-12) that lfs10d uses; a keyword it does not know is an error."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

NOTES = {"$schema", "$defs", "title", "description", "default"}
TYPES: Mapping[str, type | tuple[type, ...]] = {
    "object": dict,
    "array": list,
    "string": str,
    "integer": int,
    "number": (int, float),
    "boolean": bool,
    "null": type(None),
}


def _is(value: object, word: str) -> bool:
    return isinstance(value, TYPES[word]) and (word == "boolean" or not isinstance(value, bool))


def _same(value: object, wanted: object) -> bool:
    return value == wanted and isinstance(value, bool) is isinstance(wanted, bool)


# A keyword that is not about the type of a value is met by it.
SINGLE: Mapping[str, Callable[[Any, Any], bool]] = {
    "type": _is,
    "required": lambda value, wanted: not _is(value, "object") or set(wanted) <= set(value),
    "enum": lambda value, wanted: any(_same(value, each) for each in wanted),
    "const": _same,
    "minimum": lambda value, wanted: not _is(value, "number") or value >= wanted,
    "maximum": lambda value, wanted: not _is(value, "number") or value <= wanted,
    "pattern": lambda value, wanted: not _is(value, "string") or re.search(wanted, value) is not None,
    "minLength": lambda value, wanted: not _is(value, "string") or len(value) >= wanted,
    "maxLength": lambda value, wanted: not _is(value, "string") or len(value) <= wanted,
    "minItems": lambda value, wanted: not _is(value, "array") or len(value) >= wanted,
    "maxItems": lambda value, wanted: not _is(value, "array") or len(value) <= wanted,
    "uniqueItems": lambda value, _: not _is(value, "array") or len(set(map(repr, value))) == len(value),
}


class Validator:
    """Validates by one schema."""

    def __init__(self, schema: Mapping[str, Any]) -> None:
        self._schema = schema

    def mismatches(self, value: object) -> list[str]:
        """Return each place of a value that is refused, with the keyword that refuses it: `line.port: type`."""
        return list(self._within(value, self._schema, ""))

    def _within(self, value: object, schema: Mapping[str, Any], path: str) -> Iterator[str]:
        for keyword, wanted in schema.items():
            if keyword == "$ref":
                yield from self._within(value, self._schema["$defs"][wanted.removeprefix("#/$defs/")], path)
            elif keyword == "anyOf":
                if all(any(self._within(value, each, path)) for each in wanted):
                    yield f"{path}: {keyword}"
            elif keyword in {"properties", "items", "additionalProperties"}:
                yield from self._inside(value, schema, keyword, path)
            elif keyword not in NOTES and not SINGLE[keyword](value, wanted):
                yield f"{path}: {keyword}"

    def _inside(self, value: object, schema: Mapping[str, Any], keyword: str, path: str) -> Iterator[str]:
        if keyword == "items" and isinstance(value, list):
            for index, item in enumerate(value):
                yield from self._within(item, schema["items"], f"{path}[{index}]")
        elif keyword == "properties" and isinstance(value, dict):
            for key in schema["properties"].keys() & value.keys():
                yield from self._within(value[key], schema["properties"][key], f"{path}.{key}".lstrip("."))
        elif keyword == "additionalProperties" and isinstance(value, dict):
            form = schema["additionalProperties"]
            for key in sorted(value.keys() - schema.get("properties", {}).keys()):
                place = f"{path}.{key}".lstrip(".")
                yield from [f"{place}: {keyword}"] if form is False else self._within(value[key], form, place)
