"""One thread does what blocks, in order, and nobody waits for it at the end."""

from __future__ import annotations

import asyncio
import threading
from typing import NoReturn

import pytest

from lfs10d.system.threads import WorkerThread


def test_calls_are_made_in_order_in_one_thread_of_that_name() -> None:
    made: list[tuple[int, str, bool]] = []

    def note(number: int) -> int:
        thread = threading.current_thread()
        made.append((number, thread.name, thread.daemon))
        return number * 2

    async def scenario() -> list[int]:
        thread = WorkerThread("disk")
        results = await asyncio.gather(*(thread.call(note, number) for number in range(5)))
        thread.end()
        return results

    assert asyncio.run(scenario()) == [0, 2, 4, 6, 8]
    assert made == [(number, "disk", True) for number in range(5)]


def test_what_is_raised_is_raised_for_the_caller_and_the_next_call_is_made() -> None:
    def fail(message: str) -> NoReturn:
        raise ValueError(message)

    async def scenario() -> int:
        thread = WorkerThread("disk")
        with pytest.raises(ValueError, match="for the test"):
            await thread.call(fail, message="for the test")
        return await thread.call(lambda: 7)

    assert asyncio.run(scenario()) == 7


def test_who_no_longer_waits_abandons_the_result_alone() -> None:
    held, let_go = threading.Event(), threading.Event()

    def hold() -> None:
        held.set()
        let_go.wait(10)

    async def scenario() -> str:
        thread = WorkerThread("disk")
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(thread.call(hold), 0.01)
        let_go.set()
        return await thread.call(lambda: "next")

    assert asyncio.run(scenario()) == "next"
    assert held.is_set()


def test_a_call_that_outlives_the_loop_is_nobodys_error() -> None:
    let_go, over = threading.Event(), threading.Event()
    thread = WorkerThread("disk")

    async def scenario() -> None:
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(thread.call(let_go.wait), 0.01)

    asyncio.run(scenario())
    let_go.set()
    thread._calls.put(over.set)
    assert over.wait(10)
    thread.end()
    assert thread._thread is not None
    thread._thread.join(10)
    assert not thread._thread.is_alive()
