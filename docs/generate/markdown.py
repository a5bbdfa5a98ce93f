"""Markdown as the pages need it: tables, and JSON that is readable on a narrow screen."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator

WIDTH = 72
"""Columns of an example; what fits is kept on one line."""


def plain(text: str) -> str:
    """Return words of the code as Markdown shows them: `<name>` is no tag, `*` no emphasis."""
    return re.sub(r"`[^`]*`|[<*]", lambda found: found[0] if found[0][0] == "`" else f"\\{found[0]}", text)


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Return a table; a bar within a cell is escaped."""
    lines = (head, ("---",) * len(head), *rows)
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def example(payload: object) -> str:
    """Return a payload as a block: a bare word as it is, else JSON broken where a line would be too long."""
    text = payload if isinstance(payload, str) else "".join(_wrapped(payload, 0, WIDTH))
    return f"```{'text' if isinstance(payload, str) else 'json'}\n{text}\n```"


def _wrapped(value: object, indent: int, room: int) -> Iterator[str]:
    """Yield the pieces of a value that begins where `room` columns are left on its line."""
    flat = json.dumps(value, ensure_ascii=False, allow_nan=False)
    if len(flat) <= room or not value or not isinstance(value, dict | list):
        yield flat
        return
    if isinstance(value, dict):
        begin, items, end = "{", [(f"{json.dumps(key)}: ", item) for key, item in value.items()], "}"
    else:
        begin, items, end = "[", [("", item) for item in value], "]"
    yield f"{begin}\n"
    yield from _filled(items, indent + 2)
    yield f"\n{' ' * indent}{end}"


def _filled(items: list[tuple[str, object]], indent: int) -> Iterator[str]:
    """Yield the items, as many on a line as fit."""
    used = 0
    for number, (key, item) in enumerate(items):
        comma = "," if number + 1 < len(items) else ""
        text = f"{key}{''.join(_wrapped(item, indent, WIDTH - indent - len(key) - 1))}{comma}"
        first = len(text.partition("\n")[0])
        if used and used + 1 + first <= WIDTH:
            yield f" {text}"
            used += 1 + first
        else:
            yield f"\n{' ' * indent}{text}" if used else f"{' ' * indent}{text}"
            used = indent + first
        if "\n" in text:
            used = WIDTH
