"""A spinner on a terminal while the verb waits."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from collections.abc import AsyncIterator
from itertools import cycle
from typing import Final

AFTER: Final = 0.3
"""s after which it is shown."""
EVERY: Final = 0.12
ERASE: Final = "\r\x1b[K"
"""To the first column, and clear the line (ECMA-48, EL)."""


@contextlib.asynccontextmanager
async def spinning(words: str) -> AsyncIterator[None]:
    """Show these words and something that turns on standard error, if that is a terminal, until the block ends."""
    if not sys.stderr.isatty() or os.environ.get("TERM") in {None, "dumb"}:
        yield
        return
    task = asyncio.create_task(_spin(words))
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def _spin(words: str) -> None:
    loop = asyncio.get_running_loop()
    begun = loop.time()
    await asyncio.sleep(AFTER)
    try:
        for sign in cycle("|/-\\"):
            print(f"{ERASE}{sign} {words} {loop.time() - begun:.0f} s", end="", file=sys.stderr, flush=True)  # noqa: T201 - this is the spinner
            await asyncio.sleep(EVERY)
    finally:
        print(ERASE, end="", file=sys.stderr, flush=True)  # noqa: T201  # click.echo would strip what clears the line
