"""A store, what is kept in it and its files."""

from __future__ import annotations

from lfs10d.outbox.losses import Loss
from lfs10d.outbox.store.sample_file import StoreBatch
from lfs10d.outbox.store.store import Store
from lfs10d.telemetry.publication import Sample
from tests.support.rows import START, entries

NOW = START + 60_000


def keep(store: Store, *samples: Sample) -> tuple[Loss, ...]:
    return store.append(StoreBatch(entries(*samples), losses=(), now=NOW, mono=NOW - START))


def kept(store: Store) -> list[int]:
    return [row.sample.seq for row in store.read(0, 1_000_000)]


def names(store: Store) -> set[str]:
    return {each.name for each in store.path.parent.iterdir()}
