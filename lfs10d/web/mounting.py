"""Mounting sensors from the page: the way of `lfs10d request line/adopt --repeat`, for a person without a shell."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable
from typing import Any, Final

from lfs10d.cli.adopt_loop import AdoptLoop
from lfs10d.cli.adopt_repeat import adopt, health
from lfs10d.cli.client import CommandClient, at_daemon
from lfs10d.cli.login import Login
from lfs10d.cli.render.foreign import mapping
from lfs10d.errors import BrokerError, FailedError
from lfs10d.web.words import answer

LONGEST: Final = 2 * 3600.0
"""s after which it ends by itself: the page may have been closed."""
FIRST: Final = "Plug in a sensor."
NEXT: Final = "Plug in the next one."
SETTING_UP: Final = "A sensor is being set up: leave it connected. This takes about 20 s."
LONGEST_SEARCH: Final = 8.0
"""s for the daemon to find that no new sensor is there, where it has not done so yet; later it is known better."""
LONGER: Final = 1.5
"""Multiple of the longest search: a request that takes longer has found a sensor."""


class Mounting:
    """One mounting: requests until all names are given or it is stopped; `words` is the present message."""

    def __init__(
        self,
        login: Login,
        names: list[str],
        *,
        client: Callable[[Login], CommandClient] = CommandClient,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._loop = AdoptLoop(names)
        self._login = login
        self._names = names
        self._words = "Looking for the daemon ..."
        self._problem = ""
        self._told: tuple[object, str] = (None, "")
        """The code of the last problem, and its message: the loop reports each only once."""
        self._began = round(time.time() * 1000)
        self._task: asyncio.Task[None] | None = None
        self._client = client
        self._now = now
        self._asked_at: float | None = None
        """When the request under way was sent."""
        self._longest_search = 0.0

    @property
    def running(self) -> bool:
        """Whether it goes on."""
        return self._task is not None and not self._task.done()

    def shown(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {
            "running": self.running,
            "began": self._began,
            "words": SETTING_UP if self._found else self._words,
            "problem": self._problem,
            "names": self._names,
            "adopted": [{**each.data, "words": each.words} for each in self._loop.adopted],
        }

    @property
    def _found(self) -> bool:
        """Whether the request under way takes so long that a sensor must have answered."""
        limit = LONGER * self._longest_search or LONGEST_SEARCH
        return self._asked_at is not None and self._now() - self._asked_at > limit

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
        client = self._client(self._login)
        try:
            async with asyncio.timeout(LONGEST), at_daemon(client):
                await self._adopt(client)
            self._words = "All are adopted."
        except (BrokerError, FailedError) as error:
            self._words, self._problem = "It ended.", str(error)
        except TimeoutError:
            self._words = "It ended by itself after two hours."
        except asyncio.CancelledError:
            self._words = "Ended."
            raise

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
            self._words, self._problem = NEXT, ""
            return
        self._asked_at = self._now()
        try:
            response = await adopt(client, loop)
        finally:
            took, self._asked_at = self._now() - self._asked_at, None
        turn = loop.on_response(response)
        if turn.adopted is not None:
            self._words, self._problem = NEXT, ""
        else:
            self._learn(response, took, new=turn.problem is not None)
        if turn.ends:
            raise FailedError(self._problem)
        await asyncio.sleep(turn.pause)

    def _learn(self, response: dict[str, Any], took: float, *, new: bool) -> None:
        """Note what a response without a sensor says; its problem is shown for as long as it lasts."""
        code = mapping(response.get("error")).get("code")
        if code == "timeout" and response.get("status") == "rejected":
            self._problem, self._longest_search = "", max(took, self._longest_search)
            return
        if new:
            self._told = (code, answer(response))
        if code == self._told[0]:
            self._problem = self._told[1]

    async def _check_health(self, client: CommandClient) -> bool:
        """Request the daemon's health; return whether it shows a sensor that was adopted meanwhile."""
        return bool(list(self._loop.on_health(await health(client))))
