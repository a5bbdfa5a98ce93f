"""Mounting sensors from the page: the way of `lfs10d request line/adopt --repeat`, for a person without a shell."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import time
from typing import Any, Final

from lfs10d.cli.adopt_loop import AdoptLoop
from lfs10d.cli.adopt_repeat import ADOPT, HEALTH_WITHIN
from lfs10d.cli.client import CommandClient
from lfs10d.cli.login import Login
from lfs10d.errors import BrokerError, FailedError

LONGEST: Final = 2 * 3600.0
"""s after which it ends by itself: somebody may have closed the page and gone home."""
FIRST: Final = "Plug in a sensor."
NEXT: Final = "Plug in the next one."


class Mounting:
    """The requests, until all names are given or it is stopped; `words` is what the person reads now."""

    def __init__(self, login: Login, names: list[str]) -> None:
        self._loop = AdoptLoop(names)
        self._login = login
        self._names = names
        self._words = "Looking for the daemon ..."
        self._problem = ""
        self._began = round(time.time() * 1000)
        self._task: asyncio.Task[None] | None = None

    @property
    def running(self) -> bool:
        """Whether it goes on."""
        return self._task is not None and not self._task.done()

    def shown(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {
            "running": self.running,
            "began": self._began,
            "words": self._words,
            "problem": self._problem,
            "names": self._names,
            "adopted": [{**each.data, "words": each.words} for each in self._loop.adopted],
        }

    def start(self) -> None:
        """Begin."""
        self._task = asyncio.ensure_future(self._run())

    async def stop(self) -> None:
        """End it, and wait until it has."""
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task

    async def _run(self) -> None:
        client = CommandClient(self._login)
        try:
            async with asyncio.timeout(LONGEST):
                await client.connect()
                await client.require_daemon()
                await self._adopt(client)
            self._words = "All are adopted."
        except (BrokerError, FailedError) as error:
            self._words, self._problem = "It ended.", str(error)
        except TimeoutError:
            self._words = "It ended by itself after two hours."
        except asyncio.CancelledError:
            self._words = "Ended."
            raise
        finally:
            await client.disconnect()

    async def _adopt(self, client: CommandClient) -> None:
        await self._check_health(client)
        self._words = FIRST
        while not self._loop.complete:
            try:
                await self._turn(client)
            except BrokerError as error:
                self._loop.answer_lost()
                self._problem = f"{error}; waiting until it is there again"
                await client.wait_for_daemon()
                self._problem = ""

    async def _turn(self, client: CommandClient) -> None:
        """Send one request; raises FailedError where no plugging and unplugging will mend it."""
        loop = self._loop
        if loop.uncertain and await self._check_health(client):
            return
        content = dict(loop.content) if client.by_response_topic else {**loop.content, "id": secrets.token_hex(6)}
        turn = loop.on_response(await client.request(ADOPT, content, None) or {})
        if turn.adopted is not None:
            self._words, self._problem = NEXT, ""
        if turn.problem is not None:
            self._problem = turn.problem
        if turn.ends:
            raise FailedError(turn.problem or self._problem)
        await asyncio.sleep(turn.pause)

    async def _check_health(self, client: CommandClient) -> bool:
        """Request the daemon's health; return whether it shows a sensor that was adopted meanwhile."""
        response = await client.request("health", {"id": secrets.token_hex(6)}, HEALTH_WITHIN)
        if response is None:
            raise FailedError(f"no response to health within {HEALTH_WITHIN:g} s")
        return bool(list(self._loop.on_health(response.get("data"))))
