"""`lfs10d watch`: a live table of every slave, from MQTT or from the daemon's status file."""

from __future__ import annotations

import asyncio
import contextlib
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import click

from lfs10d.cli import config_option, event_loop, examples, json_option
from lfs10d.cli.client import RETAINED_WITHIN, CommandClient, content
from lfs10d.cli.login import Login, log_in, login_options
from lfs10d.cli.render.live_state import FRESH, TOPICS, LiveState
from lfs10d.cli.render.live_table import DataSource, age_text
from lfs10d.cli.render.live_view import LiveView, live_view
from lfs10d.cli.render.spinner import spinning
from lfs10d.cli.status_source import read_status
from lfs10d.daemon.state_directory import status_places
from lfs10d.errors import BrokerError, FailedError
from lfs10d.mqtt.messages import Filter, Incoming
from lfs10d.system.dataclass import dataclass

EVERY: Final = 0.5
"""s between two updates: fast enough to follow a cup that is turned by hand."""
SETTLES_WITHIN: Final = 0.2
"""s to wait for the remaining retained messages, so that no device is shown as unknown meanwhile."""
CONNECTS_WITHIN: Final = 6.0
"""s to connect before the daemon's status file is shown; connecting goes on meanwhile."""

EXAMPLES = examples("""
  lfs10d watch                  the service's line
  lfs10d watch -c site.yaml     the line of another daemon
  lfs10d watch | grep mast-top  one line for each new value of one sensor
  lfs10d watch --json           the same for programs
""")


@click.command("watch", epilog=EXAMPLES)
@config_option
@login_options
@json_option
def command(config: Path, username: str | None, password_file: Path | None, *, as_json: bool) -> int:
    """Show every slave of the running daemon, live, until Ctrl-C.

    From MQTT, or from the daemon's own status file while the broker, or the daemon's connection to it, is away; the
    table says which. Old values are shown as old. The sensor whose value just moved is marked. In a pipe each new
    value is one line. Exit code 69 if there is neither a broker with this daemon nor a status file.
    """
    with contextlib.suppress(KeyboardInterrupt):
        login = log_in(config, "watch", username=username, password_file=password_file, needed=False)
        files = status_places(config, login.config.line.name, os.environ)
        event_loop.run(_watch(Watch(login, files), as_json=as_json))
    return 0


async def _watch(watch: Watch, *, as_json: bool) -> None:
    """Show until cancelled; raises BrokerError where there is nothing to show."""
    try:
        await watch.find()
        await watch.show(live_view(as_json=as_json))
    finally:
        await watch.disconnect()


@dataclass(slots=True)
class _Status:
    """The daemon's status file as it was read last."""

    path: Path
    live: LiveState
    ts: float
    """When it was written, epoch s."""


class Watch:
    """Reads both sources, MQTT and the status file, and shows the better one."""

    def __init__(self, login: Login, files: tuple[Path, ...] = ()) -> None:
        self._line = login.config.line.name
        self._files = files
        self.live = LiveState(self._line)
        """The line as MQTT shows it."""
        self._why = ""
        """What was wrong with the broker, or the daemon there, at the beginning."""
        self._heard_at = 0.0
        """When the last message came by MQTT, epoch s."""
        self._status: _Status | None = None
        filters = [Filter(login.topics.full(each), qos=0, retain_as_published=False) for each in TOPICS]
        self._client = CommandClient(login, filters, self._arrived)

    @property
    def online(self) -> bool:
        """Whether the daemon is at the broker and its devices are known."""
        return self._client.daemon_online and self.live.known

    async def connect(self) -> None:
        """Connect to the broker and subscribe; raises BrokerError, FailedError."""
        await self._client.connect(CONNECTS_WITHIN)

    async def disconnect(self) -> None:
        """Disconnect from the broker."""
        await self._client.disconnect()

    async def find(self) -> None:
        """Wait for the first thing to show; raises BrokerError where there is nothing."""
        async with spinning("looking for the daemon ..."):
            try:
                await self.connect()
                await self._client.wait_until(lambda: self.live.known, RETAINED_WITHIN)
                await self._client.require_daemon()
                await asyncio.sleep(SETTLES_WITHIN)
            except (BrokerError, FailedError) as error:
                self._why = str(error)
        self._read()
        if self.live.known or self._status is not None:
            return
        places = " or ".join(str(path) for path in self._files)
        raise BrokerError(f"{self._why}; and no daemon on this machine has written its status to {places}")

    async def show(self, view: LiveView, may_draw: Callable[[], bool] = lambda: True) -> None:
        """Show the better source, whenever `may_draw()`, until cancelled."""
        with view:
            while True:
                self._read()
                live, source = self.best()
                if may_draw():
                    view.draw(live, source, now=time.monotonic(), wall=time.time())
                await asyncio.sleep(EVERY)

    def best(self) -> tuple[LiveState, DataSource]:
        """Return the better source: the broker where the daemon is online there, else a file that is being written."""
        client, status = self._client, self._status
        if self.online:
            return self.live, DataSource(f"live from {client.place}", alive=True)
        offline = f"{client.place}: the daemon is offline there"
        why = offline if client.connected else client.ended_by or self._why
        if status is not None:
            age = time.time() - status.ts
            if abs(age) <= FRESH:
                return status.live, DataSource(f"live from {status.path} ({why})", alive=True)
            if not self.live.known or status.ts > self._heard_at:
                words = f"NOT LIVE: the daemon wrote {status.path} {age_text(max(0.0, age))} ago and no more ({why})"
                return status.live, DataSource(words, alive=False)
        return self.live, DataSource(f"NOT LIVE: these are the last values received ({why})", alive=False)

    def _arrived(self, message: Incoming) -> None:
        relative = self._client.topics.relative(message.topic)
        if relative is None:
            return
        self._heard_at, payload = time.time(), content(message.payload)
        self.live.on_message(relative, payload, old=message.retained, now=time.monotonic(), wall=self._heard_at)

    def _read(self) -> None:
        """Read the status file of our line, if there is one; otherwise the last content stays and grows old."""
        if (found := read_status(self._files, self._line)) is not None:
            path, status = found
            live = LiveState(self._line) if self._status is None else self._status.live
            live.on_status(status, now=time.monotonic())
            ts = status.get("ts")
            self._status = _Status(path, live, ts / 1000 if isinstance(ts, int) else 0.0)
