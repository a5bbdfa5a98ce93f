"""The page's server in a thread of the test, its lines fed by the test: no broker, no daemon."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar, cast

from lfs10d.system.secret import Secret
from lfs10d.web.actions import Answer, LineActions
from lfs10d.web.app import application
from lfs10d.web.guard import HostList, Token
from lfs10d.web.server import http_server, listening
from lfs10d.web.site_model import SiteModel
from lfs10d.web.viewers import Viewers

TOKEN = "correct-horse-battery"  # noqa: S105 - of a test
PATIENCE = 30.0

T = TypeVar("T")


class AnsweringActions(LineActions):
    """Requests to a line whose daemon answers as the test says; `sent` are those that came."""

    def __init__(self, answers: Mapping[str, dict[str, Any]]) -> None:
        super().__init__(login=cast("Any", None))
        self.answers = dict(answers)
        self.sent: list[tuple[str, dict[str, Any]]] = []

    async def request(self, name: str, parameters: Mapping[str, Any]) -> Answer:
        """Return the answer that was given for this request."""
        self.sent.append((name, dict(parameters)))
        body = self.answers.get(name, {"status": "ok", "words": "Done."})
        return Answer(200, body)


class PageServer:
    """The server at `address`; what touches its lines goes through `do`, for they belong to its loop."""

    def __init__(self, *, token: str | None = TOKEN) -> None:
        self.site = SiteModel()
        self.viewers = Viewers(self.site, [])
        self._socket = listening("127.0.0.1", 0)
        self.port: int = self._socket.getsockname()[1]
        self.host = f"127.0.0.1:{self.port}"
        self.address = f"http://{self.host}"
        self.token = Token(None if token is None else Secret(token))
        app = application(self.viewers, self.token, HostList([]))
        self._server = http_server(app)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        deadline = time.monotonic() + PATIENCE
        while not self._server.started:
            assert time.monotonic() < deadline, "the server does not start"
            time.sleep(0.005)

    def _run(self) -> None:
        async def serve() -> None:
            feeding = asyncio.ensure_future(self.viewers.run())
            await self._server.serve(sockets=[self._socket])
            feeding.cancel()
            await asyncio.gather(feeding, return_exceptions=True)

        self._loop.run_until_complete(serve())
        self._loop.close()

    def do(self, action: Callable[[], T]) -> T:
        """Carry out an action in the server's loop and return what it returns."""

        async def carried_out() -> T:
            return action()

        return asyncio.run_coroutine_threadsafe(carried_out(), self._loop).result(PATIENCE)

    def answers(self, key: str, answers: Mapping[str, dict[str, Any]]) -> AnsweringActions:
        """Let the line's daemon answer so."""
        actions = AnsweringActions(answers)
        self.viewers._actions[key] = actions
        return actions

    def close(self) -> None:
        """End it; a second time does nothing."""
        self._server.should_exit = True
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive(), "the server does not end"

    def connect(self) -> socket.socket:
        """Return a connection, with a time limit."""
        return socket.create_connection(("127.0.0.1", self.port), PATIENCE)

    def raw(self, data: bytes) -> bytes:
        """Send bytes and return all that comes until the server closes, or the answer's end."""
        with self.connect() as connection:
            connection.sendall(data)
            return received(connection)

    def ask(
        self, head: str, *headers: str, body: bytes = b"", host: str | None = None
    ) -> tuple[int, dict[str, str], bytes]:
        """Send one request and return status, headers and body."""
        lines = [head + " HTTP/1.1", f"Host: {self.host if host is None else host}", "Connection: close", *headers]
        if body:
            lines.append(f"Content-Length: {len(body)}")
        return parsed(self.raw("\r\n".join([*lines, "", ""]).encode("latin-1") + body))

    def post(self, path: str, body: bytes = b"{}", *, token: str | None = TOKEN, **changed: str | None) -> int:
        """Send a right POST, with headers `changed` (None: left out); return its status."""
        headers: dict[str, str | None] = {"origin": self.address, "x-lfs10d": "1"}
        headers["authorization"] = None if token is None else f"Bearer {token}"
        headers |= {name.replace("_", "-"): value for name, value in changed.items()}
        return self.ask(f"POST {path}", *(f"{k}: {v}" for k, v in headers.items() if v is not None), body=body)[0]


def received(connection: socket.socket) -> bytes:
    """Return what comes until the end of the connection."""
    parts = []
    try:
        while data := connection.recv(65536):
            parts.append(data)
    except (ConnectionResetError, TimeoutError):
        pass
    return b"".join(parts)


def parsed(answer: bytes) -> tuple[int, dict[str, str], bytes]:
    """Return status, headers by name in lower case, and body of an answer; status 0 where there was none."""
    head, _, body = answer.partition(b"\r\n\r\n")
    first, *lines = head.decode("latin-1").split("\r\n")
    headers = {name.lower(): value for name, _, value in (line.partition(": ") for line in lines)}
    return int(first.split(" ")[1]) if first else 0, headers, body


@contextmanager
def serving(*, token: str | None = TOKEN) -> Iterator[PageServer]:
    """Give a server."""
    server = PageServer(token=token)
    try:
        yield server
    finally:
        server.close()
