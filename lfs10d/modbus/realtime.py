"""Makes the calling thread wake up on time: timer slack and SCHED_FIFO, set once before it waits for bytes.

A line waits 3.65 ms of silence at 9600 baud; by default the kernel wakes it up to 50 us late, and later still when
others want the processor.
"""

from __future__ import annotations

import contextlib
import os
import resource
import threading
from pathlib import Path

PROC = Path("/proc")

PRIORITY = 10
"""Of SCHED_FIFO 1..99: above all ordinary threads, below the kernel's interrupt threads (50), which bring the bytes."""


def sharpen_timers(*, proc: Path = PROC) -> bool:
    """Set the calling thread's timer slack to 1 ns (PR_SET_TIMERSLACK, by proc(5)); return whether it worked."""
    # A file, not prctl by ctypes: that costs memory, and its import fails under MemoryDenyWriteExecute= on some.
    slack = proc / str(threading.get_native_id()) / "timerslack_ns"
    try:
        slack.write_text("1", "ascii")
        # Of a real-time thread the kernel says 0.
        return slack.read_text("ascii").strip() in {"0", "1"}
    except OSError:
        return False


def take_precedence() -> str | None:
    """Put the calling thread under SCHED_FIFO; returns None, or why it is not permitted and what to do."""
    limit, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    priority = min(PRIORITY, limit) if limit > 0 else PRIORITY
    try:
        # 0 is the calling thread, not the process; what it starts is ordinary again.
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError as error:
        return (
            f"line.realtime is set, but the system does not permit SCHED_FIFO ({error.strerror}): "
            "in a service add systemd/realtime.conf.example as a drop-in, elsewhere raise the limit (ulimit -r 10), "
            "or set line.realtime to false"
        )
    return None


def yield_precedence() -> None:
    """Make the calling thread an ordinary one again; nothing happens to one that is."""
    # The flag stays: taking it off would need a privilege, and we start nothing from this thread.
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, os.sched_param(0))
