"""The watchdog is fed by progress: the line thread keeps the time it declared, and the asyncio loop turns."""

from __future__ import annotations

import sys
import threading
import traceback

GRACE = 2.0
"""How much later than declared the line thread may be, in s: opening a port and draining it may block that long."""


def progressing(declared: float, now: float) -> bool:
    """Whether the line thread, which promised a turn by `declared` (monotonic s), is on time at `now`."""
    return now <= declared + GRACE


def stacks(threads: list[threading.Thread]) -> list[str]:
    """Return one line per thread: where it stands now, for the log before the end."""
    frames = sys._current_frames()  # noqa: SLF001 - the documented way to other threads' frames
    lines = []
    for thread in threads:
        frame = frames.get(thread.ident) if thread.ident is not None else None
        if frame is not None:
            calls = [f"{call.name} ({call.filename}:{call.lineno})" for call in traceback.extract_stack(frame)]
            lines.append(f"thread {thread.name}: " + " > ".join(calls[-12:]))
    return lines
