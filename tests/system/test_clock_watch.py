"""Both clocks, and how far the wall clock can be trusted."""

from __future__ import annotations

import asyncio
import time

import pytest

from lfs10d.system import clock
from lfs10d.system.clock import Clock
from lfs10d.system.clock_step import ClockState


def test_a_moment_is_told_on_both_clocks() -> None:
    before = time.monotonic(), time.time()
    now = Clock().now()
    after = time.monotonic(), time.time()

    assert before[0] <= now.mono <= after[0]
    assert before[1] <= now.wall <= after[1]
    assert now.clock == "unknown"


class Looked:
    """A clock that answers one by one, and moments that look again at once, or when the clock is set."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, answers: list[ClockState], *, patience: float = 0.0) -> None:
        self.answers = answers
        self.told: list[str] = []
        self.waits: list[ClockState] = []
        self.at = asyncio.Event()
        """It has looked."""
        self.ahead = 0.0
        self._patience = patience
        monkeypatch.setattr(clock, "look", self._look)
        monkeypatch.setattr(clock, "look_again", self._look_again)
        real = time.time
        monkeypatch.setattr(time, "time", lambda: real() + self.ahead)
        self.moments = Clock()

    def synchronised(self) -> None:
        self.told.append("synchronised")

    def stepped(self) -> None:
        self.told.append("stepped")

    def _look(self) -> ClockState:
        if not self.answers:
            raise LookupError("no more answers")
        return self.answers.pop(0)

    def _look_again(self, state: ClockState, _age: float) -> float:
        self.waits.append(state)
        self.at.set()
        return self._patience


def test_the_clock_is_looked_after_and_told_whenever_it_becomes_synchronised(monkeypatch: pytest.MonkeyPatch) -> None:
    answers: list[ClockState] = ["unsynced", "synced", "synced", "unsynced", "synced"]
    looked = Looked(monkeypatch, list(answers))

    with pytest.raises(LookupError):
        asyncio.run(looked.moments.watch(looked))

    assert looked.waits == answers
    assert looked.told == ["synchronised", "synchronised"]


@pytest.mark.parametrize(
    ("answers", "told"),
    [
        (["unknown", "unknown"], ["stepped"]),
        (["unsynced", "synced"], ["stepped", "synchronised"]),
        (["synced", "synced"], ["synchronised"]),
    ],
)
def test_a_clock_that_is_set_is_looked_at_at_once(
    monkeypatch: pytest.MonkeyPatch, answers: list[ClockState], told: list[str]
) -> None:
    looked = Looked(monkeypatch, answers, patience=600.0)

    async def scenario() -> None:
        watching = asyncio.create_task(looked.moments.watch(looked))
        await looked.at.wait()
        looked.at.clear()
        looked.moments.now()
        looked.ahead = 400 * 86_400.0
        looked.moments.now()
        await looked.at.wait()
        watching.cancel()

    asyncio.run(scenario())
    assert looked.told == told
