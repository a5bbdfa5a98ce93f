"""When the daemon ends, and with which exit code."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest

from lfs10d.daemon.shutdown import Shutdown


@pytest.mark.parametrize(
    ("end", "code"),
    [
        (Shutdown.request, 0),
        (Shutdown.fail, 1),
        (lambda shutdown: (shutdown.request(), shutdown.fail()), 1),
        (lambda shutdown: (shutdown.fail(), shutdown.request()), 1),
    ],
)
def test_an_end_on_request_has_code_0_and_an_internal_error_1(end: Callable[[Shutdown], object], code: int) -> None:
    async def play() -> None:
        shutdown = Shutdown()
        waiting = asyncio.create_task(shutdown.wait())
        await asyncio.sleep(0)
        assert not waiting.done()
        assert shutdown.exit_code == 0
        end(shutdown)
        await asyncio.wait_for(waiting, 1)
        await asyncio.wait_for(shutdown.wait(), 1)  # and for who asks later
        assert shutdown.exit_code == code

    asyncio.run(play())
