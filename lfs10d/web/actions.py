"""Requests that viewers send to the daemon of a line: each on a connection of its own, each answer kept in words."""

from __future__ import annotations

import asyncio
import secrets
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict, field, replace
from typing import Any, Final

from lfs10d.cli.client import CommandClient, at_daemon
from lfs10d.cli.login import Login
from lfs10d.cli.request import UNLIMITED, USUAL_TIMEOUT
from lfs10d.errors import BrokerError, FailedError
from lfs10d.system.dataclass import dataclass
from lfs10d.web.mounting import Mounting
from lfs10d.web.pruned import pruned
from lfs10d.web.words import answer

RECORDS_KEPT: Final = 12
MOST_AT_ONCE: Final = 8
"""Requests to one line."""
DEEPEST_DATA: Final = 8
"""Levels of a response's data that viewers see."""

ENDED: Final = "The page's server ended before the answer came; the request may or may not have been carried out."


@dataclass(slots=True)
class RequestRecord:
    """One request; `status` is `running`, that of the response, or `lost` where there was none."""

    number: int
    name: str
    parameters: dict[str, Any]
    began: int
    status: str = "running"
    words: str = ""
    data: Any = None
    ended: int | None = None


@dataclass(frozen=True, slots=True)
class Answer:
    """What a viewer gets: the status of HTTP and the response."""

    code: int
    body: dict[str, Any]


@dataclass(slots=True)
class LineActions:
    """The requests to one line."""

    login: Login
    client: Callable[[Login], CommandClient] = CommandClient
    records: deque[RequestRecord] = field(default_factory=lambda: deque(maxlen=RECORDS_KEPT))
    mounting: Mounting | None = None
    _count: int = 0
    _running: set[asyncio.Task[Answer]] = field(default_factory=set)

    def shown(self) -> dict[str, Any]:
        """Return what viewers see of them."""
        return {
            "requests": [asdict(each) for each in self.records],
            "mounting": None if self.mounting is None else self.mounting.shown(),
        }

    async def request(self, name: str, parameters: Mapping[str, Any]) -> Answer:
        """Send a request and return its answer; it is carried out to its end even if the viewer goes away."""
        if len(self._running) >= MOST_AT_ONCE:
            return self._problem(429, name, "busy", "too many requests are under way; wait for one to end")
        task = asyncio.ensure_future(self._perform(name, dict(parameters)))
        self._running.add(task)
        task.add_done_callback(self._running.discard)
        try:
            return await asyncio.shield(task)
        except asyncio.CancelledError:
            if not task.cancelled():
                raise
            return self._problem(503, name, "unavailable", ENDED)

    def mount(self, names: list[str]) -> Answer:
        """Begin to adopt one sensor after the other, each with the next of `names` while there are any."""
        if self.mounting is not None and self.mounting.running:
            return self._problem(409, "line/adopt", "busy", "sensors are being mounted already")
        self.mounting = Mounting(_own(self.login), names, client=self.client)
        self.mounting.start()
        return Answer(200, {"status": "ok"})

    async def stop_mounting(self) -> Answer:
        """End it; what was adopted stays."""
        if self.mounting is not None:
            await self.mounting.stop()
        return Answer(200, {"status": "ok"})

    async def close(self) -> None:
        """End everything."""
        for task in list(self._running):
            task.cancel()
        await asyncio.gather(*self._running, return_exceptions=True)
        await self.stop_mounting()

    async def _perform(self, name: str, parameters: dict[str, Any]) -> Answer:
        self._count += 1
        record = RequestRecord(self._count, name, pruned(parameters), _now())
        self.records.append(record)
        content = parameters if parameters.get("id") else {**parameters, "id": secrets.token_hex(6)}
        client = self.client(_own(self.login))
        try:
            async with at_daemon(client):
                response = await client.request(name, content, None if name in UNLIMITED else USUAL_TIMEOUT)
        except (BrokerError, FailedError) as error:
            return self._lost(record, 503, str(error))
        except asyncio.CancelledError:
            self._lost(record, 503, ENDED)
            raise
        if response is None:
            words = f"No answer within {USUAL_TIMEOUT:g} s; it may or may not have been carried out."
            return self._lost(record, 504, words)
        record.ended, record.status, record.words = _now(), str(response.get("status")), answer(response)
        record.data = pruned(response.get("data"), DEEPEST_DATA)
        return Answer(200, {**response, "words": record.words})

    def _lost(self, record: RequestRecord, code: int, words: str) -> Answer:
        record.ended, record.status, record.words = _now(), "lost", words
        return self._problem(code, record.name, "unavailable", words)

    def _problem(self, code: int, name: str, error: str, words: str) -> Answer:
        details = {"code": error, "message": words}
        return Answer(code, {"v": 1, "request": name, "status": "lost", "data": None, "error": details, "words": words})


def _own(login: Login) -> Login:
    """Return the login with a client id of its own: two clients with one id would disconnect each other."""
    return replace(login, settings=replace(login.settings, client_id=f"lfs10d-web-{secrets.token_hex(4)}"))


def _now() -> int:
    return round(time.time() * 1000)
