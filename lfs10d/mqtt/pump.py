"""paho in the asyncio loop: what has come is read, what waits is written, the keepalive is looked after.

paho offers `loop_read`, `loop_write` and `loop_misc` for this (docs/decisions/0003-one-loop.md).
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Callable
from typing import Protocol

UPKEEP_EVERY = 1.0
"""Seconds between two looks at the keepalive."""


class Pumped(Protocol):
    """What a client of paho offers."""

    def loop_read(self) -> object:
        """Take what the socket has."""

    def loop_write(self) -> object:
        """Give it what waits."""

    def loop_misc(self) -> object:
        """Send a ping if it is time, end a connection that answers none."""

    def want_write(self) -> bool:
        """Return whether something waits."""


class Pump:
    """Built in the loop; idle until `begin`, and again after `end`.

    `read` is called after each reading, to deal with what it brought; `failed` with what ended a reading.
    """

    def __init__(self, client: Pumped, *, read: Callable[[], None], failed: Callable[[Exception], None]) -> None:
        self.reading = False
        """paho is reading: what it tells is dealt with when it is done."""
        self._client = client
        self._read = read
        self._failed = failed
        self._loop = asyncio.get_running_loop()
        self._opened: socket.socket | None = None
        self._descriptor: int | None = None
        self._writing = False
        self._upkeep: asyncio.TimerHandle | None = None

    def begin(self, opened: socket.socket) -> None:
        """Watch this connected socket; what is sent goes at once, for it goes together already (TCP_CORK)."""
        self._opened = opened
        # Nagle would let a sample wait for the broker's word on what went before, such as statistics by QoS 0.
        with contextlib.suppress(OSError):
            opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._descriptor = opened.fileno()
        self._loop.add_reader(self._descriptor, self._readable, opened)
        self._keep_up()

    def cork(self, *, on: bool) -> None:
        """Let what is written from here on wait for the cork to be taken off: it goes by one segment.

        A send of its own for each message costs more of the processor than all else that is done for it, here and at
        a broker beside us.
        """
        if self._opened is not None:
            try:
                self._opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_CORK, on)
            except OSError:  # it has just gone, as paho will notice
                self._opened = None

    def end(self) -> None:
        """Watch it no longer; it is still open, or its number would be another's."""
        self._opened = None
        if self._upkeep is not None:
            self._upkeep.cancel()
        if self._descriptor is not None:
            self._loop.remove_reader(self._descriptor)
            self._loop.remove_writer(self._descriptor)
        self._descriptor = self._upkeep = None
        self._writing = False

    def watch_writing(self) -> None:
        """Come back when the socket takes more, as long as paho has more for it."""
        wanted = self._descriptor is not None and self._client.want_write()
        if wanted is self._writing or self._descriptor is None:
            return
        self._writing = wanted
        if wanted:
            self._loop.add_writer(self._descriptor, self._writable)
        else:
            self._loop.remove_writer(self._descriptor)

    def _readable(self, opened: socket.socket) -> None:
        pending = getattr(opened, "pending", None)  # what TLS has decrypted makes no descriptor readable
        self.reading = True
        try:
            self._client.loop_read()
            while pending is not None and self._descriptor is not None and pending():
                self._client.loop_read()
        except Exception as caught:  # noqa: BLE001 - whatever a broker provokes ends this connection and no more
            self._failed(caught)
        finally:
            self.reading = False
        self._read()
        if self._client.want_write() is not self._writing:
            self.watch_writing()

    def _writable(self) -> None:
        self._client.loop_write()
        self.watch_writing()

    def _keep_up(self) -> None:
        self._upkeep = self._loop.call_later(UPKEEP_EVERY, self._keep_up)
        self._client.loop_misc()
        self.watch_writing()
