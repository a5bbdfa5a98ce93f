"""Reads payloads of which any client may be the author: what is not of the documented form is as if it were absent.

Pure.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Any


def mapping(value: object) -> Mapping[str, Any]:
    """Return a value that is an object; an empty one for any other."""
    return value if isinstance(value, Mapping) else {}


def named(entries: object) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the objects of a list that have a name, each with it."""
    for entry in entries if isinstance(entries, list) else ():
        if isinstance(entry, dict) and isinstance(name := entry.get("name"), str):
            yield name, entry


def number(value: object) -> float | None:
    """Return a value that is a finite number; whole ones stay whole."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return value if isfinite(value) else None
    except OverflowError:
        return None
