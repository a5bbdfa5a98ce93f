"""A daemon's inside in virtual time: a simulated line, the poller, the configuration, the journal; and power cuts.

The disk forgets what was not synced. A life ends with `cut`, at any step on the disk and between any two exchanges; the
next one begins with what is on the disk. What blocks is called at once, so that a run can be repeated exactly.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.support.lives import Bench, T, _mistake
from tests.support.virtual_loop import Loop


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    async def at_once(call: Callable[[], T], name: str) -> T:
        del name
        return call()

    for module in ("reconfiguration.runner", "config.live_config", "commands.handlers.device"):
        monkeypatch.setattr(f"lfs10d.{module}.run_in_thread", at_once)
    loop = Loop()
    loop.set_exception_handler(_mistake)
    made = Bench(tmp_path, loop)
    yield made
    for task in asyncio.all_tasks(loop):
        task.cancel()
    made.pump()
    loop.close()
