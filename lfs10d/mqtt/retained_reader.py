"""Reads our own retained topics over the first connection: the shell around `Lookback`."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Mapping
from collections.abc import Set as AbstractSet

from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.lookback import Lookback
from lfs10d.mqtt.messages import Filter, Incoming
from lfs10d.mqtt.reasons import REFUSED_FROM
from lfs10d.mqtt.topics import Topics
from lfs10d.system.tasks import BackgroundTasks


class RetainedReader:
    """Used in the thread of the asyncio loop; `on_found` is given what was found, by topic under `B`, once."""

    def __init__(
        self, topics: Topics, wanted: AbstractSet[str], on_found: Callable[[Mapping[str, bytes]], Awaitable[None]]
    ) -> None:
        self._topics = topics
        self._wanted = wanted
        self._on_found = on_found
        self._lookback: Lookback | None = None
        self._subscription: int | None = None
        self._progress = asyncio.Event()
        self._tasks = BackgroundTasks()
        self._task: asyncio.Task[None] | None = None
        self._then: Callable[[], None] = lambda: None
        self.over = False
        """`on_found` is done; nothing is to be read any more."""

    def begin(self, connection: Connection, then: Callable[[], None]) -> None:
        """Read over this connection; `then()` is called when it is over, unless the connection is lost before."""
        self._then = then
        if self._task is not None:
            return  # `on_found` runs already
        self._lookback = Lookback(self._topics, self._wanted, self._now())
        self._task = self._tasks.start("reading retained topics", self._read(connection, self._lookback), self._ended)

    def subscribed(self, mid: int, reasons: tuple[int, ...]) -> None:
        """Take the broker's answer to a subscription."""
        if self._lookback is not None and mid == self._subscription:
            self._lookback.subscribed(self._now(), refused=all(reason >= REFUSED_FROM for reason in reasons))
            self._progress.set()

    def arrived(self, message: Incoming) -> None:
        """Take a message."""
        if self._lookback is not None and message.retained:
            self._lookback.on_message(message.topic, message.payload, self._now())
            self._progress.set()

    def lost(self) -> None:
        """Note that the connection is lost: what it said is read anew over the next one."""
        self._then = lambda: None
        if self._lookback is not None and self._task is not None:
            self._lookback = None
            task, self._task = self._task, None
            task.cancel()

    async def _read(self, connection: Connection, lookback: Lookback) -> None:
        # Without retain_as_published the flag tells what was retained before, and nothing else.
        self._subscription = connection.subscribe(
            [Filter(each, qos=0, retain_as_published=False, no_local=True) for each in lookback.filters]
        )
        while (wait := lookback.due(self._now()) - self._now()) > 0:
            self._progress.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(wait):
                    await self._progress.wait()
        self._lookback = None
        connection.unsubscribe(lookback.filters)
        await self._on_found(lookback.found)

    def _ended(self, task: asyncio.Task[None]) -> None:
        if task is not self._task:
            return
        self.over = True
        self._then()

    def _now(self) -> float:
        return asyncio.get_running_loop().time()
