"""The HTTP server around the application: its socket, its limits, its end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import click
import uvicorn
from starlette.types import ASGIApp

from lfs10d.cli.login import Login
from lfs10d.config.credentials import reason
from lfs10d.errors import BrokerError
from lfs10d.schema.addresses import node_text
from lfs10d.system.secret import Secret
from lfs10d.web.app import application
from lfs10d.web.connection import LARGEST_HEAD, LimitedConnection
from lfs10d.web.feed import feeds
from lfs10d.web.guard import HostList, Token, loopback
from lfs10d.web.site_model import SiteModel
from lfs10d.web.viewers import Viewers

BACKLOG: Final = 64
ENDS_WITHIN: Final = 1
"""s for open responses."""


class _Server(uvicorn.Server):
    """uvicorn without its signal handlers: the verb has its own."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave the signals alone."""
        yield


def http_server(app: ASGIApp) -> uvicorn.Server:
    """Return the server of an application, with the limits of the page."""
    return _Server(
        uvicorn.Config(
            app,
            http=LimitedConnection,
            ws="none",
            lifespan="off",
            log_config=None,
            access_log=False,
            proxy_headers=False,
            server_header=False,
            backlog=BACKLOG,
            timeout_graceful_shutdown=ENDS_WITHIN,
            h11_max_incomplete_event_size=LARGEST_HEAD,
        )
    )


async def serve(
    logins: Sequence[tuple[Path, Login]], listen: tuple[str, int], token: Secret | None, names: Sequence[str]
) -> None:
    """Serve until cancelled; raises BrokerError where the address cannot be used."""
    _log_errors()
    site = SiteModel()
    own = feeds(logins, site)
    viewers = Viewers(site, own)
    listener = listening(*listen)
    app = application(viewers, Token(token), HostList([*names, *_own_names(listen[0])]))
    server = http_server(app)
    connecting = [asyncio.ensure_future(feed.connect()) for feed in own]
    feeding = asyncio.ensure_future(viewers.run())
    serving = asyncio.ensure_future(server.serve(sockets=[listener]))
    host, port = listener.getsockname()[:2]
    rights = "reading, and requests with the token" if token else "reading only: no token"
    click.echo(f"lfs10d web: http://{node_text(host, port)}/ ({rights}); Ctrl-C ends it")
    sys.stdout.flush()
    try:
        await asyncio.shield(serving)
    finally:
        for task in (feeding, *connecting):
            task.cancel()
        await asyncio.gather(feeding, *connecting, return_exceptions=True)
        server.should_exit = True
        await asyncio.gather(viewers.close(), *(feed.disconnect() for feed in own), return_exceptions=True)
        await serving


def _log_errors() -> None:
    """Log what goes wrong inside on standard error, and nothing of what clients send."""
    handler = logging.StreamHandler()
    handler.setLevel(logging.ERROR)
    handler.setFormatter(logging.Formatter("lfs10d web: %(message)s"))
    log = logging.getLogger("uvicorn.error")
    log.addHandler(handler)
    log.propagate = False


def listening(host: str, port: int) -> socket.socket:
    """Return the listening socket; raises BrokerError, by which a busy port ends with 69."""
    place = node_text(host, port)
    try:
        (family, kind, protocol, _, address), *_ = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
        listener = socket.socket(family, kind, protocol)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(BACKLOG)
    except OSError as error:
        raise BrokerError(f"cannot listen on {place}: {reason(error)}; choose another with --listen") from None
    listener.setblocking(False)  # noqa: FBT003  # of the library
    return listener


def _own_names(host: str) -> list[str]:
    """Return the names of this machine where others may ask for it."""
    if loopback(host):
        return [host]
    name = socket.gethostname()
    return [host, name, f"{name.partition('.')[0]}.local"]
