"""JSON safe to print on a terminal: control and direction characters are escaped. Pure."""

from __future__ import annotations

import json


def json_text(value: object, *, indent: int | None = None) -> str:
    r"""Return a value as JSON, readable letters as they are, all else escaped: `\u202e` for what would turn the text.

    Reading it gives the same value.
    """
    text = json.dumps(value, indent=indent, ensure_ascii=False)
    return "".join(sign if sign.isprintable() or sign == "\n" else _escaped(sign) for sign in text)


def _escaped(sign: str) -> str:
    """Return a character as JSON escapes it, one beyond the first 65 536 as its two surrogates."""
    units = sign.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[at : at + 2].hex()}" for at in range(0, len(units), 2))
