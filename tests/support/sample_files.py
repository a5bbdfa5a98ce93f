"""A file of samples: kept, read, opened again."""

from __future__ import annotations

from pathlib import Path

from lfs10d.outbox.losses import Loss
from lfs10d.outbox.store.database import Limits
from lfs10d.outbox.store.sample_file import SampleFile, StoreBatch
from lfs10d.telemetry.publication import Sample
from tests.support.rows import BOOT, ROOMY, START, entries

NOW = START + 60_000


def keep(file: SampleFile, *samples: Sample, shift: int = START) -> tuple[Loss, ...]:
    return file.append(StoreBatch(entries(*samples, shift=shift), losses=file.losses, now=NOW, mono=NOW - START))


def kept(file: SampleFile) -> list[Sample]:
    return [row.sample for row in file.read(0, 1_000_000)]


def reopened(file: SampleFile, path: Path, *, boot: str = BOOT, limits: Limits = ROOMY) -> SampleFile:
    file.close()
    return SampleFile(path, boot=boot, limits=limits)
