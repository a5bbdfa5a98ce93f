"""The viewers' one stream: the changes of all lines twice a second, encoded once for all viewers."""

from __future__ import annotations

import asyncio
import json
import secrets
import time
from collections.abc import AsyncIterator, Sequence
from typing import Any, Final

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response, StreamingResponse

from lfs10d.web.actions import LineActions
from lfs10d.web.feed import Feed
from lfs10d.web.guard import viewer_of
from lfs10d.web.line_model import LineModel
from lfs10d.web.site_model import SiteModel, Stream, event_bytes

EVERY: Final = 0.5
"""s between two events: fast enough to follow a cup that is turned by hand."""
AT_LEAST_EVERY: Final = 2.0
"""s without an event after which a viewer shows that it is not live."""
MOST_VIEWERS: Final = 64
MOST_OF_ONE: Final = 40
"""Viewers of one address: nobody keeps all others out."""
BEHIND: Final = 60
"""Events that wait for a viewer before its stream is ended; it comes back and resumes."""
RETRY: Final = b"retry: 2000\n\n"


class Viewers:
    """The lines, their requests, and the open streams to viewers."""

    def __init__(self, site: SiteModel, feeds: Sequence[Feed]) -> None:
        self.site = site
        self._feeds = feeds
        self._actions: dict[str, LineActions] = {}
        self._stream = Stream(secrets.token_hex(4))
        self._queues: dict[asyncio.Queue[bytes | None], str] = {}
        """Of each open stream, with its viewer's address."""
        self._sent_at = 0.0
        self._looked_at = 0.0

    def figures(self) -> dict[str, int]:
        """Return how many lines are shown, and to how many viewers."""
        return {"lines": len(self.site.lines), "viewers": len(self._queues)}

    def look(self) -> None:
        """Take what connections and status files say, at most once in half a second."""
        now = time.monotonic()
        if now - self._looked_at >= EVERY:
            self._looked_at = now
            for feed in self._feeds:
                feed.look()

    def actions(self, key: str) -> LineActions | None:
        """Return the requests of a line; None where there is no such line."""
        line = self.site.lines.get(key)
        if line is None:
            return None
        if key not in self._actions:
            feed = next(feed for feed in self._feeds if feed.base == line.base)
            self._actions[key] = LineActions(feed.request_login(line))
        return self._actions[key]

    def _more(self, line: LineModel) -> dict[str, Any]:
        actions = self._actions.get(line.key)
        return {"requests": [], "mounting": None} if actions is None else actions.shown()

    def whole(self) -> str:
        """Return everything as JSON; viewers get what changed before it."""
        self.look()
        self._publish()
        return json.dumps(self.site.whole(time.time(), self._more), separators=(",", ":"))

    async def run(self) -> None:
        """Feed the viewers until cancelled."""
        try:
            while True:
                await asyncio.sleep(EVERY)
                self.look()
                if self._queues:
                    self._publish()
        finally:
            for queue in self._queues:
                queue.put_nowait(None)

    async def close(self) -> None:
        """End all requests."""
        for actions in self._actions.values():
            await actions.close()

    def _publish(self) -> None:
        wall, now = time.time(), time.monotonic()
        changed = self.site.changes(wall, self._more)
        if not changed and now - self._sent_at < AT_LEAST_EVERY:
            return
        self._sent_at = now
        data = json.dumps({"now": round(wall * 1000), "lines": changed}, separators=(",", ":"))
        event = self._stream.add(data)
        for queue in list(self._queues):
            if queue.qsize() >= BEHIND:
                self._queues.pop(queue, None)
                queue.put_nowait(None)
            else:
                queue.put_nowait(event)

    async def events(self, request: Request) -> Response:
        """Return the stream, from where the viewer lost it, or from the whole."""
        address = viewer_of(request.client.host if request.client else "?")
        own = list(self._queues.values()).count(address)
        if len(self._queues) >= MOST_VIEWERS or own >= MOST_OF_ONE:
            return PlainTextResponse("Too many viewers.\n", 503, headers={"retry-after": "10"})
        last = request.headers.get("last-event-id")
        headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
        return StreamingResponse(self._events(last, address), media_type="text/event-stream", headers=headers)

    async def _events(self, last: str | None, address: str) -> AsyncIterator[bytes]:
        queue: asyncio.Queue[bytes | None] = asyncio.Queue()
        missed = self._stream.since(last)
        whole = self.whole() if missed is None else ""
        if missed is None:
            missed = [event_bytes("state", whole, self._stream.last_id)]
        self._queues[queue] = address
        try:
            yield RETRY + b"".join(missed)
            while (event := await queue.get()) is not None:
                yield event
        finally:
            self._queues.pop(queue, None)
