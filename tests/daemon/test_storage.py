"""Whether what must be kept can be kept."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from pathlib import Path

import pytest

from lfs10d.daemon import storage as module
from lfs10d.daemon.boot import Boot
from lfs10d.daemon.storage import Storage
from lfs10d.reading import FaultCode, LineFaultCode


@pytest.fixture
def told() -> list[str | None]:
    """Give what was told, in order."""
    return []


def storage_at(directory: Path, tell: Callable[[str | None], None]) -> Storage:
    """Return the storage of a life whose id is on the disk; `tell` takes each error of the line."""

    def set_line_error(code: LineFaultCode, message: str | None) -> None:
        assert code is FaultCode.STORAGE_FULL
        tell(message)

    return Storage(directory, Boot("k0000001", None, kept=True), set_line_error)


def test_a_directory_that_cannot_be_written_is_told_once_and_when_it_can_be(
    tmp_path: Path, told: list[str | None], caplog: pytest.LogCaptureFixture
) -> None:
    place = tmp_path / "place"
    place.write_text("a file")
    storage = storage_at(place / "state", told.append)

    storage.look()
    storage.look()
    place.unlink()
    storage.look()

    first, over = told
    assert first is not None
    assert "cannot be written" in first
    assert over is None
    assert [(record.levelno, record.message) for record in caplog.records] == [(logging.WARNING, first)]


def test_a_backlog_that_cannot_be_kept_is_trouble_though_the_directory_is_well(
    tmp_path: Path, told: list[str | None]
) -> None:
    storage = storage_at(tmp_path, told.append)

    storage.on_backlog_trouble("the disk is full")
    storage.look()
    storage.on_backlog_trouble("the disk is read-only")
    storage.on_backlog_trouble(None)

    assert told == ["the disk is full", "the disk is read-only", None]


def test_what_could_not_be_written_is_told_each_time(tmp_path: Path, told: list[str | None]) -> None:
    storage = storage_at(tmp_path, told.append)

    storage.on_failure("changes.yaml cannot be written")
    storage.on_failure("changes.yaml cannot be written")

    assert told == ["changes.yaml cannot be written"] * 2


def test_the_end_of_trouble_is_found_though_nobody_asks(
    tmp_path: Path, told: list[str | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "LOOK_EVERY", 0.001)
    place = tmp_path / "place"
    place.write_text("a file")

    async def scenario() -> None:
        over = asyncio.Event()

        def tell(trouble: str | None) -> None:
            told.append(trouble)
            if trouble is None:
                over.set()

        storage = storage_at(place / "state", tell)
        storage.look()
        place.unlink()
        async with asyncio.timeout(10), asyncio.TaskGroup() as group:
            watching = group.create_task(storage.watch())
            await over.wait()
            watching.cancel()

    asyncio.run(scenario())
    assert len(told) == 2
    assert told[1] is None
