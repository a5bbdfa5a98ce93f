"""Decides whether the watchdog is fed: the line thread keeps its declared time, and the asyncio loop turns."""

from __future__ import annotations

import sys
import threading
import traceback

GRACE = 2.0
"""Permitted delay of the line thread in s: opening a port and draining it may block that long."""


def progressing(declared: float, now: float) -> bool:
    """Return whether the line thread, which promised a turn by `declared` (monotonic s), is on time at `now`."""
    return now <= declared + GRACE


def stacks(threads: list[threading.Thread]) -> list[str]:
    """Return the stack of each thread on one line, for the log before the end."""
    frames = sys._current_frames()  # noqa: SLF001 - the documented way to other threads' frames
    lines = []
    for thread in threads:
        frame = frames.get(thread.ident) if thread.ident is not None else None
        if frame is not None:
            calls = [f"{call.name} ({call.filename}:{call.lineno})" for call in traceback.extract_stack(frame)]
            lines.append(f"thread {thread.name}: " + " > ".join(calls[-12:]))
    return lines
