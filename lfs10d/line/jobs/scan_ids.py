"""The slave ids of a scan, and their notation."""

from __future__ import annotations

LAST_ID = 255
"""LFS10-RS485 Protocol, slave id 0x01..0xFF: wider than the 247 of Modbus."""


def ids_of(text: str) -> tuple[int, ...]:
    """Return the ids of text such as `1-8,12`, in order; raises ValueError that says what is wrong."""
    ids: set[int] = set()
    for part in text.split(","):
        first, dash, last = (piece.strip() for piece in part.partition("-"))
        ends = (first, last) if dash else (first,)
        if not all(end.isascii() and end.isdecimal() and len(end) <= len(str(LAST_ID)) for end in ends):
            raise ValueError(f"{part.strip()!r} is neither an id such as 3 nor a range such as 1-8")
        low, high = int(first), int(ends[-1])
        if not 1 <= low <= high <= LAST_ID:
            raise ValueError(f"{part.strip()!r}: ids go from 1 to {LAST_ID}, the smaller first")
        ids.update(range(low, high + 1))
    return tuple(sorted(ids))
