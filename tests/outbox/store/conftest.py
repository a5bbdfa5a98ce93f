"""Samples for the store, and files of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from lfs10d.outbox.store.sample_file import SampleFile
from lfs10d.outbox.store.store import Store
from tests.support.rows import BOOT, ROOMY


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Give the path of a file that is not there yet."""
    return tmp_path / "backlog.db"


@pytest.fixture
def file(path: Path) -> Iterator[SampleFile]:
    """Give a new file."""
    opened = SampleFile(path, boot=BOOT, limits=ROOMY)
    yield opened
    opened.close()


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    """Give a store in a folder that is not there yet."""
    made = Store(tmp_path / "state", boot=BOOT, limits=ROOMY)
    yield made
    made.close()
