"""Brokers that reply with given bytes, and one of 2014 that knows MQTT 3.1.1 only."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, field
from typing import TypeAlias

Answer: TypeAlias = "Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]"


CONNECT, PUBLISH, SUBSCRIBE, PINGREQ, DISCONNECT = 0x10, 0x30, 0x82, 0xC0, 0xE0


@contextlib.asynccontextmanager
async def serving(answer: Answer, port: int = 0) -> AsyncIterator[int]:
    """Serve each client with `answer` on a port of the loopback; at the end all clients are thrown out."""
    served: set[asyncio.Task[None]] = set()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        served.add(task)
        try:
            with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError, asyncio.CancelledError):
                await answer(reader, writer)
        finally:
            writer.close()
            with contextlib.suppress(ConnectionError, asyncio.CancelledError):
                await writer.wait_closed()
            served.discard(task)

    server = await asyncio.start_server(serve, "127.0.0.1", port)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for task in list(served):
            task.cancel()
        await asyncio.gather(*served)


@dataclass
class OldBroker:
    """A broker of 2014: MQTT 3.1.1 (level 4) and nothing else. It keeps what is published to it.

    `refusal` is what a client of MQTT 5 is told before it is thrown out; None: nothing, and it may stay.
    """

    refusal: bytes | None = b"\x20\x02\x00\x01"
    levels: list[int] = field(default_factory=list)
    """The protocol level of each CONNECT."""
    published: list[tuple[str, bytes]] = field(default_factory=list)
    granted: bytes = b"\x01\x01"
    """What each filter of a SUBSCRIBE is told."""

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[int]:
        """Listen on a free port of the loopback."""
        async with serving(self._serve) as port:
            yield port

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while await self._answer(reader, writer):
            await writer.drain()

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> bool:
        head = (await reader.readexactly(1))[0]
        length = shift = 0
        while True:
            byte = (await reader.readexactly(1))[0]
            length |= (byte & 0x7F) << shift
            shift += 7
            if not byte & 0x80:
                break
        body = await reader.readexactly(length)
        if head == CONNECT:
            self.levels.append(body[6])
            if body[6] == 4:
                writer.write(b"\x20\x02\x00\x00")
            elif self.refusal is None:
                return True
            else:
                writer.write(self.refusal)
            return body[6] == 4
        if head & 0xF0 == PUBLISH:
            end = 2 + int.from_bytes(body[:2], "big")
            mid = body[end : end + 2] if head & 0x06 else b""
            self.published.append((body[2:end].decode(), body[end + len(mid) :]))
            if mid:
                writer.write(b"\x40\x02" + mid)
        elif head == SUBSCRIBE:
            writer.write(bytes((0x90, 2 + len(self.granted))) + body[:2] + self.granted)
        elif head == PINGREQ:
            writer.write(b"\xd0\x00")
        return head != DISCONNECT
