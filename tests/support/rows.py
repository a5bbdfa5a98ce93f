"""Samples and entries for the store."""

from __future__ import annotations

from collections.abc import Mapping

from lfs10d.outbox.history import QueuedSample
from lfs10d.outbox.store.database import Limits
from lfs10d.reading import Value
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry.publication import Sample

BOOT = "k0000002"
START = 1_795_298_022_000
"""Epoch ms of seq 0."""
ROOMY = Limits(size=512_000_000, age=7 * 86_400_000)


def sample(
    seq: int,
    device: str = "a",
    *,
    boot: str = BOOT,
    values: Mapping[str, Value] | None = None,
    error: str | None = None,
    clock: ClockState = "synced",
    ts: int | None = None,
) -> Sample:
    """Return a sample, one a second; a good one of `seq / 8` unless told otherwise."""
    good = error is None
    measured: Mapping[str, Value] = {"wind_speed": seq / 8} if values is None else values
    return Sample(
        device=device,
        boot=boot,
        seq=seq,
        ts=START + 1000 * seq if ts is None else ts,
        clock=clock,
        values=measured if good else None,
        units=dict.fromkeys(measured, "m/s"),
        names=tuple(measured),
        quality="good" if good else "bad",
        error=error,
        rtt_ms=18.2 if good else None,
    )


def entries(*samples: Sample, shift: int = START, repeated: bool = False) -> list[QueuedSample]:
    """Return samples as they are handed to the store."""
    return [QueuedSample(each, 0.0, repeated, shift) for each in samples]
