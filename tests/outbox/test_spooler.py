"""Samples between the outbox and a real store, on a loop whose clock is moved by hand."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

from lfs10d.outbox.backlog import HISTORY_AFTER
from lfs10d.outbox.items import HistoryBatch
from lfs10d.outbox.losses import Loss
from lfs10d.outbox.recent_acks import AGAIN_WITHIN
from lfs10d.outbox.spill import SPILL_EVERY
from lfs10d.telemetry import publication
from tests.support.spoolers import ROOMY, Place, play, until, working


def test_what_the_broker_does_not_take_goes_to_disk_and_from_there_to_the_broker(tmp_path: Path) -> None:
    async def scenario() -> None:
        place = Place(tmp_path)
        async with working(place):
            place.add(1, 250)
            await place.move(3.5)
            await until(lambda: place.store.rows == 250, "the spill")
            assert place.outbox.stats == publication.BacklogStats(depth=250, oldest_ts=1000, dropped=0)
            place.connect()
            await place.move(HISTORY_AFTER)
            await until(lambda: bool(place.outbox.backlog.spool.page), "the page")
            told = place.settle_next()
            for _ in range(2):
                await place.move(0.2)
                told += place.settle_next()
            assert told == list(range(1, 251))
            assert place.outbox.depth == 0
            assert place.store.rows == 250
            await place.move(AGAIN_WITHIN + 0.5)
            await until(lambda: place.store.rows == 0, "the end of the rows")
        assert place.troubles == []
        assert place.woken > 0

    play(scenario())


def test_at_the_end_what_waits_is_on_disk_and_what_was_acknowledged_is_not(tmp_path: Path) -> None:
    async def scenario() -> None:
        place = Place(tmp_path)
        async with working(place):
            place.add(1, 150)
            await place.move(3.5)
            await until(lambda: place.store.rows == 150, "the spill")
            place.connect()
            await place.move(HISTORY_AFTER)
            await until(lambda: bool(place.outbox.backlog.spool.page), "the page")
            assert place.settle_next() == list(range(1, 101))
            place.add(151, 160)
            place.outbox.backlog.on_clean_exit()
            place.outbox.lost(asyncio.get_running_loop().time())
        assert place.on_disk() == list(range(101, 161))

    play(scenario())


def test_what_waited_before_is_found_and_what_was_lost_is_declared(tmp_path: Path) -> None:
    async def scenario() -> None:
        before = Place(tmp_path)
        async with working(before):
            before.add(1, 3)
            before.outbox.backlog.losses.restore(Loss("a", "k1", 1, 2, 2))
        place = Place(tmp_path)
        async with working(place):
            await until(lambda: place.outbox.depth == 3, "the backlog")
            assert place.outbox.backlog.undeclared() == [Loss("a", "k1", 1, 2, 2)]
            assert place.outbox.stats.oldest_ts == 1000

    play(scenario())


def test_losses_that_stay_are_kept_within_five_seconds_and_forgotten_when_they_are_declared(tmp_path: Path) -> None:
    async def scenario() -> None:
        place = Place(tmp_path)
        async with working(place):
            await until((tmp_path / "backlog.db").exists, "the file")
            place.connect()
            place.outbox.backlog.losses.restore(Loss("a", "k2", 1, 2, 2))
            place.spooler.poke()
            await asyncio.sleep(0.1)
            await place.move(SPILL_EVERY + 0.1)
            await until(lambda: place.store.losses == (Loss("a", "k2", 1, 2, 2),), "the loss")
            await place.move(HISTORY_AFTER)
            assert place.settle_next() == []  # the declaration
            await asyncio.sleep(0.1)
            await place.move(SPILL_EVERY + 0.1)
            await until(lambda: place.store.losses == (), "its end")

    play(scenario())


def test_a_file_put_aside_is_told_as_an_event(tmp_path: Path) -> None:
    (tmp_path / "backlog.db").write_text("x" * 5000)

    async def scenario() -> None:
        place = Place(tmp_path)
        async with working(place):
            await until(lambda: bool(place.events), "the event")
        assert [each.payload for each in place.events] == [
            {
                "v": 1,
                "type": "store_put_aside",
                "ts": 1_000_000,
                "file": "backlog.db.corrupt-k2",
                "reason": "is damaged: file is not a database",
            }
        ]

    play(scenario())


def test_other_limits_and_a_clock_set_right_reach_the_disk_and_the_page(tmp_path: Path) -> None:
    async def scenario() -> None:
        place = Place(tmp_path)
        async with working(place):
            place.add(1, 2, clock="unsynced")
            await place.move(3.5)
            await until(lambda: place.store.rows == 2, "the spill")
            place.connect()
            await place.move(HISTORY_AFTER)
            place.spooler.correct(7000)
            await until(lambda: bool(place.outbox.backlog.spool.page), "the page")
            place.outbox.correct(7000)
            item = place.outbox.next(asyncio.get_running_loop().time())
            assert isinstance(item, HistoryBatch)
            assert [(queued.sample.ts, queued.sample.clock) for queued in item.samples] == [
                (8000, "synced"),
                (9000, "synced"),
            ]
            place.outbox.lost(asyncio.get_running_loop().time())
            place.spooler.limit(replace(ROOMY, age=1))
            place.epoch_ms = 10**9
            place.add(3, 3)
            await place.move(4)
            await until(lambda: place.outbox.stats.dropped == 2, "the eviction")
        assert place.on_disk() == [3]

    play(scenario())
