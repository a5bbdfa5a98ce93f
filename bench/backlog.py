"""What a daemon leaves on the disk that was without its broker for long: made once, copied for each run."""

from __future__ import annotations

import atexit
import shutil
import tempfile
import time
from functools import cache
from pathlib import Path

from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.store.database import Limits
from lfs10d.outbox.store.sample_file import SampleFile, StoreBatch
from lfs10d.telemetry.publication import Sample

BOOT = "k0000000"
"""Of the life before; its samples are no answers of this run's sensors."""
DEVICES = 10
EVERY_MS = 1000
TOGETHER = 20
"""Samples of one device next to each other, as a spill leaves them."""
_LIMITS = Limits(size=10**12, age=10**12)


def _sample(device: int, seq: int, ts: int) -> Sample:
    return Sample(
        f"slave-{device}", BOOT, seq, ts, "synced", {"wind_speed": seq % 997 / 32}, {"wind_speed": "m/s"},
        ("wind_speed",), "good", None, 18.2,
    )  # fmt: skip


@cache
def _made(count: int) -> Path:
    folder = Path(tempfile.mkdtemp(prefix="lfs10d-backlog-"))
    atexit.register(shutil.rmtree, folder)
    now = time.time_ns() // 1_000_000
    each = count // DEVICES
    file = SampleFile(folder / "backlog.db", boot=BOOT, limits=_LIMITS)
    for start in range(0, each, 10 * TOGETHER):
        entries = [
            QueuedSample(_sample(device, seq, now - (each - seq) * EVERY_MS), 0.0, shift=0)
            for part in range(start, min(each, start + 10 * TOGETHER), TOGETHER)
            for device in range(1, DEVICES + 1)
            for seq in range(part + 1, min(part + TOGETHER, each) + 1)
        ]
        file.append(StoreBatch(entries, losses=(), now=now, mono=0))
    file.close()
    return folder / "backlog.db"


def leave(state: Path, count: int) -> None:
    """Put a backlog of `count` samples of ten devices at 1 Hz into a state directory."""
    state.mkdir(parents=True)
    shutil.copy(_made(count), state / "backlog.db")
