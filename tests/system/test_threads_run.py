"""Blocking calls beside the loop."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading

import pytest

from lfs10d.system.threads import run_in_thread


def test_what_the_call_returns_comes_back() -> None:
    here = threading.get_ident()

    there = asyncio.run(run_in_thread(threading.get_ident, "elsewhere"))

    assert there != here


def test_what_the_call_raises_is_raised() -> None:
    def fail() -> None:
        raise LookupError("no such thing")

    with pytest.raises(LookupError, match="no such thing"):
        asyncio.run(run_in_thread(fail, "failing"))


def thread_called(name: str) -> threading.Thread:
    """Return the thread of that name."""
    return next(thread for thread in threading.enumerate() if thread.name == name)


def test_who_no_longer_waits_is_told_nothing() -> None:
    go_on = threading.Event()

    async def give_up() -> bool:
        task = asyncio.create_task(run_in_thread(go_on.wait, "abandoned"))
        await asyncio.sleep(0)
        task.cancel()
        thread = thread_called("abandoned")
        go_on.set()
        await asyncio.to_thread(thread.join)
        await asyncio.sleep(0)  # what it told is passed over here
        return task.cancelled()

    assert asyncio.run(give_up())


def test_a_loop_that_is_closed_is_told_nothing() -> None:
    """Else the error of the thread would fail this test."""
    go_on = threading.Event()

    async def leave() -> None:
        task = asyncio.create_task(run_in_thread(go_on.wait, "left behind"))
        await asyncio.sleep(0)
        task.cancel()

    asyncio.run(leave())
    thread = thread_called("left behind")
    go_on.set()
    thread.join(10)

    assert not thread.is_alive()


def test_a_call_that_never_returns_does_not_hold_the_end_of_the_process_up() -> None:
    code = """
import asyncio, time
from lfs10d.system.threads import run_in_thread
async def run():
    task = asyncio.create_task(run_in_thread(lambda: time.sleep(3600), "for ever"))
    await asyncio.sleep(0.01)
    task.cancel()
asyncio.run(run())
"""
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0
