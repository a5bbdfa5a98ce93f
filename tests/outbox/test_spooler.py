"""Samples between the outbox and a real store, on a loop whose clock is moved by hand."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import AsyncIterator, Callable, Coroutine
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from lfs10d.outbox.backlog import HISTORY_AFTER
from lfs10d.outbox.items import HistoryBatch, samples_of
from lfs10d.outbox.losses import Loss
from lfs10d.outbox.outbox import Outbox
from lfs10d.outbox.recent_acks import AGAIN_WITHIN
from lfs10d.outbox.spill import SPILL_EVERY
from lfs10d.outbox.spooler import Spooler
from lfs10d.outbox.store.database import Limits
from lfs10d.outbox.store.store import Store, StoreError
from lfs10d.system.clock_step import ClockState
from lfs10d.telemetry import publication
from lfs10d.telemetry.publication import Publication, PublicationKind, Sample

ROOMY = Limits(size=512_000_000, age=7 * 86_400_000)
ONLINE = publication.retained("availability", "online")
PATIENCE = 10.0


class MovedLoop(asyncio.SelectorEventLoop):
    """A loop whose time is the real one and what it was moved on by."""

    moved = 0.0

    def time(self) -> float:
        """Return the time."""
        return super().time() + self.moved


def sample(seq: int, *, clock: ClockState = "synced", ts: int | None = None) -> Publication:
    measured = Sample(
        "a", "k2", seq, 1000 * seq if ts is None else ts, clock, {"x": seq / 8}, {"x": "m/s"}, ("x",), "good", None, 1.5
    )
    return Publication(
        "device/a/telemetry", measured.payload("line0"), PublicationKind.SAMPLE, retain=False, qos=1, sample=measured
    )


@dataclass
class Place:
    """A stowage and what it told."""

    folder: Path
    limits: Limits = ROOMY
    troubles: list[str | None] = field(default_factory=list)
    events: list[Publication] = field(default_factory=list)
    woken: int = 0
    epoch_ms: int = 1_000_000

    def __post_init__(self) -> None:
        self.outbox = Outbox()
        self.store = Store(self.folder, boot="k2", limits=self.limits)
        self.spooler = Spooler(
            self.outbox,
            self.store,
            epoch_ms=lambda: self.epoch_ms,
            wake=self.wake,
            on_trouble=self.troubles.append,
            publish=self.events.append,
        )

    def wake(self) -> None:
        """Count."""
        self.woken += 1

    def add(self, first: int, last: int, *, clock: ClockState = "synced") -> None:
        """Measure."""
        for seq in range(first, last + 1):
            self.outbox.add(sample(seq, clock=clock), asyncio.get_running_loop().time(), shift=0)
        self.spooler.poke()

    async def move(self, seconds: float) -> None:
        """Let time pass, and what is due then begin."""
        loop = asyncio.get_running_loop()
        assert isinstance(loop, MovedLoop)
        loop.moved += seconds
        self.spooler.poke()
        for _ in range(5):
            await asyncio.sleep(0)

    def connect(self) -> None:
        """Have the broker there, the burst settled."""
        now = asyncio.get_running_loop().time()
        self.outbox.connected(now)
        self.outbox.burst([], ONLINE)
        while not self.outbox.announced:
            item = self.outbox.next(now)
            assert item is not None
            self.outbox.on_ack(item, now)
        self.spooler.poke()

    def settle_next(self) -> list[int]:
        """Have the broker take what goes next; return its seqs."""
        now = asyncio.get_running_loop().time()
        item = self.outbox.next(now)
        if item is None:
            return []
        self.outbox.on_ack(item, now)
        self.spooler.poke()
        return [queued.sample.seq for queued in samples_of(item)]

    def on_disk(self) -> list[int]:
        """Return the seqs that another life would find."""
        other = Store(self.folder, boot="k3", limits=ROOMY)
        other.open()
        found = [row.sample.seq for row in other.read(0, 10_000)]
        other.close()
        return found


async def until(claim: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + PATIENCE
    while not claim():
        assert time.monotonic() < deadline, what
        await asyncio.sleep(0.005)


@contextlib.asynccontextmanager
async def working(place: Place) -> AsyncIterator[Place]:
    """Start and stop a stowage."""
    place.spooler.start()
    try:
        yield place
    finally:
        await place.spooler.stop(PATIENCE)


def play(scenario: Coroutine[None, None, None]) -> None:
    with asyncio.Runner(loop_factory=MovedLoop) as runner:
        runner.run(scenario)


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
            place.outbox.backlog.part()
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
            await until(lambda: place.outbox.dropped == 2, "the eviction")
        assert place.on_disk() == [3]

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
    assert "3 samples that wait for the broker are not kept" in caplog.text


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
