"""A spooler and a real store on a loop whose clock is moved by hand."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable, Coroutine
from dataclasses import dataclass, field
from pathlib import Path

from lfs10d.outbox.items import samples_of
from lfs10d.outbox.outbox import Outbox
from lfs10d.outbox.spooler import Spooler
from lfs10d.outbox.store.database import Limits
from lfs10d.outbox.store.store import Store
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
    """A spooler and what it reported."""

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
    """Start and stop a spooler."""
    place.spooler.start()
    try:
        yield place
    finally:
        await place.spooler.stop(PATIENCE)


def play(scenario: Coroutine[None, None, None]) -> None:
    with asyncio.Runner(loop_factory=MovedLoop) as runner:
        runner.run(scenario)
