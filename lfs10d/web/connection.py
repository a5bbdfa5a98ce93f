"""HTTP connections with limits: how many, how long one may be idle, how slowly it may be read."""

from __future__ import annotations

import asyncio
from typing import Any, Final

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_CONNECTIONS: Final = 160
MOST_PER_ADDRESS: Final = 100
LARGEST_HEAD: Final = 16_384
"""Bytes of request line and headers."""
HEAD_WITHIN: Final = 10.0
"""s for a request to be complete after the connection or the request before."""
WRITES_WITHIN: Final = 20.0
"""s for a client to take what waits for it."""
REFUSED: Final = (
    b"HTTP/1.1 503 Service Unavailable\r\ncontent-type: text/plain; charset=utf-8\r\n"
    b"retry-after: 5\r\nconnection: close\r\ncontent-length: 21\r\n\r\nToo many connections\n"
)


class LimitedConnection(H11Protocol):
    """One connection of a client."""

    _timer: asyncio.TimerHandle | None = None
    _stalled: asyncio.TimerHandle | None = None
    _refused = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        """Take a connection where there is room; an idle one makes room for it."""
        super().connection_made(transport)
        if not self._has_room():
            self._refused = True
            transport.write(REFUSED)
            transport.close()
            return
        self._wait_for_request()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the timers."""
        for timer in (self._timer, self._stalled):
            if timer is not None:
                timer.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take bytes of a request."""
        if self._refused:
            return
        super().data_received(data)
        if not self.idle and self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        if not self.transport.is_closing() and self.idle:
            self._wait_for_request()

    def pause_writing(self) -> None:
        """Give a client that does not read some time."""
        super().pause_writing()
        self._stalled = self.loop.call_later(WRITES_WITHIN, self.transport.abort)

    def resume_writing(self) -> None:
        """Go on: it reads."""
        super().resume_writing()
        if self._stalled is not None:
            self._stalled.cancel()
            self._stalled = None

    @property
    def idle(self) -> bool:
        """Whether no request is under way."""
        cycle: Any = self.cycle  # None before the first request
        return cycle is None or cycle.response_complete is True

    def _wait_for_request(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self.loop.call_later(HEAD_WITHIN, self.transport.abort)

    def _has_room(self) -> bool:
        others: list[Any] = [
            each for each in self.connections if each is not self and isinstance(each, LimitedConnection)
        ]
        here = [each for each in others if each.client and self.client and each.client[0] == self.client[0]]
        for group, most in ((here, MOST_PER_ADDRESS), (others, MOST_CONNECTIONS)):
            if len(group) >= most:
                idle = next((each for each in group if each.idle and not each.transport.is_closing()), None)
                if idle is None:
                    return False
                idle.connections.discard(idle)
                idle.transport.abort()
        return True
