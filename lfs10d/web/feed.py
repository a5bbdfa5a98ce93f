"""The sources of the lines: one connection per base topic, and the status files of this machine's daemons."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from lfs10d.cli.client import CommandClient, content
from lfs10d.cli.login import Login
from lfs10d.cli.render.live_state import TOPICS
from lfs10d.cli.status_source import read_status
from lfs10d.daemon.state_directory import status_places
from lfs10d.errors import BrokerError, FailedError
from lfs10d.mqtt.messages import Filter, Incoming
from lfs10d.mqtt.topics import Topics
from lfs10d.web.line_model import LineModel
from lfs10d.web.site_model import SiteModel

CONNECTS_WITHIN: Final = 6.0
LARGEST_PAYLOAD: Final = 2**18
"""Bytes."""
RELATIVE: Final = (*TOPICS, "availability", "info", "event", "trace", "device/+/history", "device/+/config")
"""Topics under a line that are shown."""


def feeds(logins: Sequence[tuple[Path, Login]], site: SiteModel, *, others: bool = True) -> list[Feed]:
    """Return one feed for each broker and base topic; `others`: also the lines there that no file names."""
    made: dict[tuple[object, ...], Feed] = {}
    for file, login in logins:
        settings, base = login.settings, login.topics.base.rpartition("/")[0]
        nodes = tuple((node.host, node.port) for node in settings.nodes)
        place = (nodes, settings.username, base) if others else (nodes, settings.username, login.topics.base)
        if place not in made:
            made[place] = Feed(login, site, others=others)
        made[place].add_file(file, login)
    return list(made.values())


class Feed:
    """One connection; it goes on trying for ever. `login` is that of the first configuration."""

    def __init__(self, login: Login, site: SiteModel, *, others: bool) -> None:
        self.login = login
        self._site = site
        self.base, _, self._own = login.topics.base.rpartition("/")
        self._files: list[tuple[LineModel, tuple[Path, ...]]] = []
        self._others = others
        self._why = ""
        self._client = self._made(f"{self.base}/+" if others else login.topics.base)

    def _made(self, prefix: str) -> CommandClient:
        filters = [Filter(f"{prefix}/{each}", qos=0, retain_as_published=False) for each in RELATIVE]
        return CommandClient(self.login, filters, self._arrived)

    def add_file(self, file: Path, login: Login) -> None:
        """Show the line of a configuration too, whether it is at the broker or not."""
        line = self._line(login.config.line.name)
        if line is not None:
            self._files.append((line, status_places(file, line.name, os.environ)))

    def request_login(self, line: LineModel) -> Login:
        """Return how requests to a line of this feed are sent."""
        return replace(self.login, topics=Topics.of(self.base, line.name))

    @property
    def connected(self) -> bool:
        """Whether there is a connection."""
        return self._client.connected

    @property
    def settled(self) -> bool:
        """Whether the own daemon's devices are known."""
        return any(line.source(time.time()).kind == "broker" for line, _ in self._files)

    async def connect(self) -> None:
        """Connect and subscribe, to the own line alone where the broker permits no more; never raises."""
        try:
            await self._client.connect(CONNECTS_WITHIN)
        except FailedError as error:
            await self._client.disconnect()
            self._why = str(error)
            if self._others:
                self._others = False
                self._client = self._made(self.login.topics.base)
                await self.connect()
        except BrokerError as error:
            self._why = str(error)

    async def disconnect(self) -> None:
        """End the connection."""
        await self._client.disconnect()

    def look(self) -> None:
        """Take the news of the connection and the status files."""
        client = self._client
        for line in self._lines():
            link = line.link
            link.connected = client.connected
            link.place = client.place
            link.why = "" if client.connected else client.ended_by or self._why
            if not client.connected:
                link.daemon = None  # what is retained comes again with the next connection
            elif line.name == self._own:
                link.daemon = client.availability
        for line, places in self._files:
            if (found := read_status(places, line.name)) is not None:
                line.on_status(str(found[0]), found[1], now=time.monotonic())

    def _lines(self) -> Iterator[LineModel]:
        return (line for line in self._site.lines.values() if line.base == self.base)

    def _line(self, name: str) -> LineModel | None:
        return self._site.line(self.base, name, self.login.settings.place)

    def _arrived(self, message: Incoming) -> None:
        relative = message.topic.removeprefix(f"{self.base}/")
        name, _, rest = relative.partition("/")
        if len(message.payload) > LARGEST_PAYLOAD or not rest:
            return
        line = self._line(name)
        if line is not None:
            now, wall = time.monotonic(), time.time()
            line.on_message(rest, content(message.payload), old=message.retained, now=now, wall=wall)


async def settle(feed: Feed, within: float = 1.0, rest: float = 0.3) -> None:
    """Connect, and wait for what is retained."""
    await feed.connect()
    deadline = time.monotonic() + within
    while True:
        feed.look()
        if feed.settled or time.monotonic() > deadline or not feed.connected:
            break
        await asyncio.sleep(0.02)
    await asyncio.sleep(rest if feed.connected else 0.0)
    feed.look()
