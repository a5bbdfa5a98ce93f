"""A device's values as text for a table. Pure; what came over the network is escaped."""

from __future__ import annotations

from lfs10d.reading import Value
from lfs10d.system.logs import escape


def plain_text(value: Value) -> str:
    """Return a value as it is, a fraction with two decimals: figures that stand still are read at a glance."""
    if isinstance(value, str):
        return escape(value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value) if isinstance(value, int) else f"{value:.2f}"


def with_unit(name: str, value: Value, unit: str, *, alone: bool) -> str:
    """Return a value with its unit; among others a bare number and a yes or no with its name."""
    shown = plain_text(value)
    if isinstance(value, bool) or (unit == "1" and not isinstance(value, str)):
        return shown if alone else f"{escape(name)} {shown}"
    return shown if unit == "1" else f"{shown} {escape(unit)}".rstrip()
