"""The port freed for a while: what is told and done in which order, in virtual time."""

from __future__ import annotations

import asyncio
from typing import Any

from lfs10d.commands.pause import LinePause


class Bench:
    """Notes what was done, in order."""

    def __init__(self) -> None:
        self.done: list[str | None] = []
        self.opened = asyncio.Event()
        fake: Any = self
        self.pausing = LinePause(fake, fake)

    def set_paused(self, *, paused: bool) -> None:
        self.done.append("paused" if paused else None)

    def resume(self) -> None:
        self.done.append("open")
        self.opened.set()

    async def pause(self) -> None:
        self.done.append("free")


def test_a_pause_ends_by_itself_and_an_error_counts_again_before_the_port_is_opened() -> None:
    async def scene() -> None:
        bench = Bench()
        await bench.pausing.pause(0.0)
        assert bench.pausing.paused
        await asyncio.wait_for(bench.opened.wait(), 10)
        assert bench.done == ["paused", "free", None, "open"]
        assert not bench.pausing.end()
        assert len(bench.done) == 4

    asyncio.run(scene())


def test_a_second_pause_replaces_the_first_and_ends_once() -> None:
    async def scene() -> None:
        bench = Bench()
        await bench.pausing.pause(0.0)
        await bench.pausing.pause(600.0)
        for _ in range(20):
            await asyncio.sleep(0.001)
        assert bench.pausing.paused
        assert bench.pausing.end()
        assert bench.done == ["paused", "free", "paused", "free", None, "open"]

    asyncio.run(scene())
