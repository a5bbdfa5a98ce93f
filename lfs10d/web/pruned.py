"""Cuts foreign payloads to what a browser can read and a page can show. Pure."""

from __future__ import annotations

from typing import Any, Final

LONGEST_TEXT: Final = 500
MOST_ITEMS: Final = 300
MOST_NUMBER: Final = 1e300


def pruned(value: Any, depth: int = 6) -> Any:  # noqa: ANN401 - any JSON
    """Return the part of any JSON that may be shown: finite numbers, texts, lists and objects of a reasonable size."""
    match value:
        case None | bool():
            return value
        case int() | float():
            return value if abs(value) < MOST_NUMBER else None
        case str():
            return value[:LONGEST_TEXT]
        case list() if depth:
            return [pruned(each, depth - 1) for each in value[:MOST_ITEMS]]
        case dict() if depth:
            items = list(value.items())[:MOST_ITEMS]
            return {str(key)[:LONGEST_TEXT]: pruned(each, depth - 1) for key, each in items}
    return None
