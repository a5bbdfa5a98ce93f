"""Both clocks, and how far the wall clock can be trusted."""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING

import pytest

from lfs10d import clock
from lfs10d.moments import Moments

if TYPE_CHECKING:
    from lfs10d.clock import ClockState


def test_a_moment_is_told_on_both_clocks() -> None:
    before = time.monotonic(), time.time()
    now = Moments(lambda: None).now()
    after = time.monotonic(), time.time()

    assert before[0] <= now.mono <= after[0]
    assert before[1] <= now.wall <= after[1]
    assert now.clock == "unknown"


def test_the_clock_is_looked_after_and_told_whenever_it_becomes_synchronised(monkeypatch: pytest.MonkeyPatch) -> None:
    answers: list[ClockState] = ["unsynced", "synced", "synced", "unsynced", "synced"]
    seen: list[ClockState] = []
    synchronised: list[ClockState] = []

    def look() -> ClockState:
        if not answers:
            raise LookupError("no more answers")
        return answers.pop(0)

    async def slept(_seconds: float) -> None:
        seen.append(moments.now().clock)

    monkeypatch.setattr(clock, "look", look)
    monkeypatch.setattr(asyncio, "sleep", slept)
    moments = Moments(lambda: synchronised.append(moments.now().clock))

    with pytest.raises(LookupError):
        asyncio.run(moments.watch())

    assert seen == ["unsynced", "synced", "synced", "unsynced", "synced"]
    assert synchronised == ["synced", "synced"]
