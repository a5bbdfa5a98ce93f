"""A client in the loop: what its socket does has it read and write; it is looked after."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest

from lfs10d.mqtt.pump import Pump

Ends = tuple[socket.socket, socket.socket]

PATIENCE = 5.0


@dataclass
class Client:
    """Reads up to `takes` bytes at a time and writes what waits; `looks` counts how often it was looked after."""

    socket: socket.socket
    takes: int = 100
    heard: bytes = b""
    waiting: bytes = b""
    looks: int = 0
    ends_with: Exception | None = None

    def loop_read(self) -> None:
        if self.ends_with is not None:
            raise self.ends_with
        self.heard += self.socket.recv(self.takes)

    def loop_write(self) -> None:
        self.socket.send(self.waiting)
        self.waiting = b""

    def loop_misc(self) -> None:
        self.looks += 1

    def want_write(self) -> bool:
        return bool(self.waiting)


@pytest.fixture
def ends() -> Iterator[Ends]:
    ours, theirs = socket.socketpair()
    ours.settimeout(0.0)
    theirs.settimeout(5.0)
    yield ours, theirs
    ours.close()
    theirs.close()


def never(error: Exception) -> None:
    raise error


async def until(claim: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not claim():
        assert time.monotonic() < deadline
        await asyncio.sleep(0.001)


def test_what_comes_is_read_and_then_dealt_with(ends: Ends) -> None:
    async def run() -> None:
        client = Client(ends[0])
        dealt: list[tuple[bytes, bool]] = []
        pump = Pump(client, read=lambda: dealt.append((client.heard, pump.reading)), failed=never)
        ends[1].send(b"one")
        pump.begin(ends[0])
        await until(lambda: bool(dealt))
        assert dealt == [(b"one", False)]
        assert client.looks == 1

    asyncio.run(run())


def test_what_tls_has_decrypted_already_is_read_too(ends: Ends) -> None:
    class Decrypted(socket.socket):
        def pending(self) -> int:
            return 6 - len(client.heard)

    async def run() -> None:
        pump = Pump(client, read=lambda: None, failed=never)
        ends[1].send(b"sealed")
        pump.begin(wrapped)
        await until(lambda: client.heard == b"sealed")
        pump.end()

    with Decrypted(fileno=ends[0].detach()) as wrapped:
        wrapped.settimeout(0.0)
        client = Client(wrapped, takes=2)
        asyncio.run(run())


def test_what_waits_is_written_when_the_socket_takes_it(ends: Ends) -> None:
    async def run() -> None:
        client = Client(ends[0], waiting=b"early")
        pump = Pump(client, read=lambda: None, failed=never)
        pump.watch_writing()  # nothing to watch yet
        pump.begin(ends[0])
        await until(lambda: not client.waiting)
        client.waiting = b" late"
        pump.watch_writing()
        pump.watch_writing()
        await until(lambda: not client.waiting)
        assert ends[1].recv(100) == b"early late"
        client.waiting = b"never"
        pump.watch_writing()
        client.waiting = b""
        pump.watch_writing()  # paho wrote it by itself meanwhile
        await asyncio.sleep(0.01)
        pump.end()
        ends[1].settimeout(0.0)
        with pytest.raises(BlockingIOError):
            ends[1].recv(100)

    asyncio.run(run())


def test_an_error_of_the_client_is_reported(ends: Ends) -> None:
    async def run() -> None:
        error = ValueError("garbage")
        client = Client(ends[0], ends_with=error)
        failed: list[Exception] = []

        def end(caught: Exception) -> None:
            failed.append(caught)
            pump.end()

        pump = Pump(client, read=lambda: None, failed=end)
        ends[1].send(b"one")
        pump.begin(ends[0])
        await until(lambda: bool(failed))
        ends[1].send(b"two")
        await asyncio.sleep(0.01)
        assert failed == [error]
        assert not pump.reading

    asyncio.run(run())


def test_it_is_looked_after_until_the_end(ends: Ends, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lfs10d.mqtt.pump.UPKEEP_EVERY", 0.002)

    async def run() -> None:
        client = Client(ends[0])
        pump = Pump(client, read=lambda: None, failed=never)
        pump.begin(ends[0])
        await until(lambda: client.looks > 3)
        pump.end()
        pump.end()
        looks = client.looks
        await asyncio.sleep(0.02)
        assert client.looks == looks

    asyncio.run(run())
