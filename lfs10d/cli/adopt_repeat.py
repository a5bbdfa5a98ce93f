"""`lfs10d request line/adopt --repeat`: the shell around `AdoptLoop`, at a terminal, in a pipe or for a program."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
from collections.abc import Sequence
from typing import Any, Final

import click

from lfs10d.cli import EXIT_FAILED, print_lines
from lfs10d.cli.adopt_loop import FIRST, NEXT, AdoptedSensor, AdoptLoop
from lfs10d.cli.client import CommandClient
from lfs10d.cli.login import Login
from lfs10d.cli.render.spinner import spinning
from lfs10d.cli.render.table import columns
from lfs10d.errors import BrokerError, FailedError

ADOPT: Final = "line/adopt"
HEALTH_WITHIN: Final = 10.0
WAITING: Final = "waiting for a sensor ..."


async def repeat(login: Login, loop: AdoptLoop, *, as_json: bool) -> int:
    """Adopt sensors until all names are given or it is cancelled; return the exit code.

    0 if all were adopted that were named, or, without names, any. Raises BrokerError where broker or daemon is not
    there at the beginning; later it waits for them.
    """
    client = CommandClient(login)
    ended_well = True
    try:
        with contextlib.suppress(asyncio.CancelledError):  # a signal: all are adopted
            ended_well = await _AdoptRepeat(client, loop, as_json=as_json).run()
    finally:
        await client.disconnect()
        if loop.adopted and not as_json:
            print_lines(summary(loop.adopted))
    if not loop.adopted:
        click.echo("No sensor was adopted.", err=True)
    return 0 if ended_well and loop.adopted and not loop.unfinished else EXIT_FAILED


def summary(adopted: Sequence[AdoptedSensor]) -> list[str]:
    """Return the adopted sensors as a table."""
    rows = [[each.device, str(each.slave or "?"), str(each.baudrate or "?")] for each in adopted]
    count = f"{len(adopted)} {'sensor' if len(adopted) == 1 else 'sensors'} adopted:"
    return [count, *columns(("name", "id", "baud"), rows, right={1, 2})]


async def adopt(client: CommandClient, loop: AdoptLoop) -> dict[str, Any]:
    """Send the loop's next request; return its response, with an id only where nothing else identifies that.

    The daemon keeps the response to each id on its disk for a day: too much for a request every few seconds.
    """
    content = loop.content if client.by_response_topic else {**loop.content, "id": secrets.token_hex(6)}
    return await client.request(ADOPT, content, None) or {}


async def health(client: CommandClient) -> object:
    """Request the daemon's health and return it; raises FailedError where it does not respond."""
    response = await client.request("health", {"id": secrets.token_hex(6)}, HEALTH_WITHIN)
    if response is None:
        raise FailedError(f"no response to health within {HEALTH_WITHIN:g} s")
    return response.get("data")


class _AdoptRepeat:
    """The requests and reports, until it is cancelled."""

    def __init__(self, client: CommandClient, loop: AdoptLoop, *, as_json: bool) -> None:
        self._client = client
        self._loop = loop
        self._as_json = as_json

    async def run(self) -> bool:
        """Adopt one after the other; return whether nothing stopped it."""
        async with spinning(f"{ADOPT} ..."):
            await self._client.connect()
            await self._client.require_daemon()
            await self._check_health()
        self._print(FIRST)
        while not self._loop.complete:
            try:
                if not await self._turn():
                    return False
            except BrokerError as error:
                self._loop.answer_lost()
                self._print(f"{error}; waiting until it is there again", problem=True)
                async with spinning(WAITING):
                    await self._client.wait_for_daemon()
                self._print("It is there again.", problem=True)
        return True

    async def _turn(self) -> bool:
        """Send one request; return whether to go on."""
        loop = self._loop
        async with spinning(WAITING):
            if loop.uncertain and await self._check_health():
                return True
            turn = loop.on_response(await adopt(self._client, loop))
        if turn.adopted is not None:
            self._report(turn.adopted)
        if turn.problem is not None:
            self._print(turn.problem, problem=True)
        if turn.ends:
            return False
        async with spinning(WAITING):
            await asyncio.sleep(turn.pause)
        return True

    async def _check_health(self) -> bool:
        """Request the daemon's health; return whether it shows a sensor that was adopted meanwhile."""
        found = list(self._loop.on_health(await health(self._client)))
        for each in found:
            self._report(each)
        return bool(found)

    def _report(self, adopted: AdoptedSensor) -> None:
        if self._as_json:
            click.echo(json.dumps(adopted.data))
        else:
            self._print(adopted.words)
        if not self._loop.complete:
            self._print(NEXT)

    def _print(self, words: str, *, problem: bool = False) -> None:
        click.echo(words, err=problem or self._as_json)
