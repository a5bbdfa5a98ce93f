"""A daemon behind the page's requests, in virtual time: each request waits until the test answers it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar, cast

from lfs10d.cli.client import CommandClient
from lfs10d.cli.login import Login
from lfs10d.config.models import Config
from lfs10d.mqtt.settings import BrokerSettings
from lfs10d.mqtt.topics import Topics
from tests.support.virtual_loop import Loop

T = TypeVar("T")
OK: dict[str, Any] = {"status": "ok", "data": {}}


def login() -> Login:
    """Return a login that nobody uses."""
    return Login(
        cast("Config", None), BrokerSettings("localhost", 1883, "lfs10d-line0-web"), Topics.of("lfs10d", "line0")
    )


class FakeDaemon:
    """Hands out connections to it; `refuses` is what each raises when it connects."""

    def __init__(self, *, by_response_topic: bool = True) -> None:
        self.loop = Loop()
        self.refuses: Exception | None = None
        self.by_response_topic = by_response_topic
        self.asked: list[tuple[str, dict[str, Any], float | None]] = []
        self.client_ids: list[str] = []
        self.connected = 0
        self.there = asyncio.Event()
        self._answers: list[asyncio.Future[Any]] = []

    def close(self) -> None:
        """End what is still under way, and the loop."""
        tasks = asyncio.all_tasks(self.loop)
        for task in tasks:
            task.cancel()
        self.loop.drain()
        assert all(task.done() for task in tasks)
        self.loop.close()

    def client(self, own: Login) -> CommandClient:
        """Return a connection, as `CommandClient` would be."""
        self.client_ids.append(own.settings.client_id)
        return cast("CommandClient", _Connection(self))

    def run(self, action: Callable[[], T]) -> T:
        """Carry out an action in the loop and all that follows at once."""

        async def carried_out() -> T:
            return action()

        return self.task(carried_out()).result()

    def task(self, coroutine: Coroutine[Any, Any, T]) -> asyncio.Task[T]:
        """Begin a coroutine and do all that can be done at once."""
        task = self.loop.create_task(coroutine)
        self.loop.drain()
        return task

    def wait(self, seconds: float) -> None:
        """Let time go by."""
        self.loop.clock.now += seconds
        self.loop.drain()

    def answer(self, response: dict[str, Any] | Exception | None) -> None:
        """Answer the oldest request, or let it fail."""
        waiting = self._answers.pop(0)
        if isinstance(response, Exception):
            waiting.set_exception(response)
        else:
            waiting.set_result(response)
        self.loop.drain()

    async def ask(self, name: str, content: dict[str, Any], within: float | None) -> Any:  # noqa: ANN401 - any JSON
        """Wait for the test's answer."""
        self.asked.append((name, content, within))
        waiting: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        self._answers.append(waiting)
        return await waiting


class _Connection:
    def __init__(self, daemon: FakeDaemon) -> None:
        self._daemon = daemon
        self.by_response_topic = daemon.by_response_topic

    async def connect(self) -> None:
        self._daemon.connected += 1
        if self._daemon.refuses is not None:
            raise self._daemon.refuses

    async def require_daemon(self) -> None:
        pass

    async def wait_for_daemon(self) -> None:
        await self._daemon.there.wait()

    async def request(self, name: str, content: dict[str, Any], within: float | None) -> Any:  # noqa: ANN401 - any JSON
        return await self._daemon.ask(name, content, within)

    async def disconnect(self) -> None:
        self._daemon.connected -= 1
