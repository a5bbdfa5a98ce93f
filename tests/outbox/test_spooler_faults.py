"""A disk that is full, hangs or cannot be written."""

from __future__ import annotations

import asyncio
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

from lfs10d.outbox.losses import Loss
from lfs10d.outbox.spill import SPILL_EVERY
from lfs10d.outbox.store.store import StoreError
from tests.support.spoolers import PATIENCE, ROOMY, Place, play, until, working


def test_a_disk_that_cannot_be_written_is_told_once_and_so_is_its_return(tmp_path: Path) -> None:
    async def scenario() -> None:
        blocked = tmp_path / "state"
        blocked.touch()
        place = Place(blocked)
        async with working(place):
            await until(lambda: len(place.troubles) == 1, "the trouble")
            place.add(1, 5)
            for _ in range(3):
                await place.move(SPILL_EVERY + 0.1)
                await asyncio.sleep(0.05)
            assert len(place.troubles) == 1
            assert place.troubles[0] is not None
            assert "wait in memory" in place.troubles[0]
            assert place.outbox.depth == 5
            blocked.unlink()
            await place.move(SPILL_EVERY + 0.1)
            await until(lambda: place.troubles[-1] is None, "the return")
            await until(lambda: place.store.rows == 5, "the spill")
            assert len(place.troubles) == 2

    play(scenario())


def test_a_spill_that_fails_waits_in_memory_and_is_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def scenario() -> None:
        place = Place(tmp_path)

        def full(*_: object, **__: object) -> tuple[Loss, ...]:
            raise StoreError("the disk is full")

        async with working(place):
            await until((tmp_path / "backlog.db").exists, "the file")
            with monkeypatch.context() as patch:
                patch.setattr(place.store, "append", full)
                place.add(1, 4)
                await place.move(3.5)
                await until(lambda: len(place.troubles) == 1, "the trouble")
                assert place.outbox.depth == 4
            await place.move(SPILL_EVERY + 0.1)
            await until(lambda: place.troubles[-1] is None, "the end of the trouble")
            assert place.store.rows == 4

    play(scenario())


def test_a_store_without_room_keeps_nothing_and_makes_no_file(tmp_path: Path) -> None:
    async def scenario() -> None:
        place = Place(tmp_path, limits=replace(ROOMY, size=0))
        async with working(place):
            place.add(1, 3)
            await place.move(4)
            await asyncio.sleep(0.05)
            assert place.outbox.depth == 3
        assert place.troubles == []

    play(scenario())
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_hangs_does_not_hold_up_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    let_go = threading.Event()

    async def scenario() -> None:
        place = Place(tmp_path)
        monkeypatch.setattr(place.store, "open", lambda: let_go.wait(PATIENCE) and ())
        place.spooler.start()
        place.add(1, 3)
        began = time.monotonic()
        await place.spooler.stop(0.05)
        assert time.monotonic() - began < PATIENCE / 2

    play(scenario())
    let_go.set()
    assert "3 samples that wait for the broker are not kept on disk" in caplog.text


def test_a_mistake_of_ours_is_told_and_ends_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def scenario() -> None:
        place = Place(tmp_path)
        monkeypatch.setattr(place.store, "open", lambda: 1 // 0)
        place.spooler.start()
        await until(lambda: bool(place.troubles), "the trouble")
        assert place.troubles[0] is not None
        assert "until a restart" in place.troubles[0]
        monkeypatch.undo()
        await place.spooler.stop(PATIENCE)

    play(scenario())
    assert "an internal error" in caplog.text
