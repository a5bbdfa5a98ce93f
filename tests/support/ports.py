"""A serial port on a pty and its far end."""

from __future__ import annotations

import select

FRAME = bytes.fromhex("01 03 00 01 00 02 95 CB")
PATIENCE = 10.0


def readable(fd: int, within: float = PATIENCE) -> bool:
    """Wait until the descriptor is readable."""
    return bool(select.select([fd], [], [], within)[0])
