"""`lfs10d request line/adopt --repeat`: the shell around `AdoptLoop`, at a terminal, in a pipe or for a program."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
from collections.abc import Sequence
from typing import Any, Final

import click

from lfs10d.cli import EXIT_FAILED
from lfs10d.cli.adopt_loop import FIRST, NEXT, AdoptedSensor, AdoptLoop
from lfs10d.cli.client import CommandClient
from lfs10d.cli.login import Login
from lfs10d.cli.render.spinner import spinning
from lfs10d.cli.render.table import columns
from lfs10d.errors import BrokerError, FailedError

ADOPT: Final = "line/adopt"
HEALTH_WITHIN: Final = 10.0
WORDS: Final = "waiting for a sensor ..."


async def mount(visited: Login, mounting: AdoptLoop, *, as_json: bool) -> int:
    """Have sensors adopted until all names are given or it is cancelled; return the exit code.

    0 if all were adopted that were named, or, without names, any. Raises BrokerError where broker or daemon is not
    there at the beginning; later they are waited for.
    """
    visitor = CommandClient(visited)
    ended_well = True
    try:
        with contextlib.suppress(asyncio.CancelledError):  # a signal: all are mounted
            ended_well = await _Repeating(visitor, mounting, as_json=as_json).go_on()
    finally:
        await visitor.leave()
        if mounting.adopted and not as_json:
            for text in summary(mounting.adopted):
                click.echo(text)
    if not mounting.adopted:
        click.echo("No sensor was adopted.", err=True)
    return 0 if ended_well and mounting.adopted and not mounting.lacking else EXIT_FAILED


def summary(adopted: Sequence[AdoptedSensor]) -> list[str]:
    """Return what was mounted, as a table."""
    rows = [[each.device, str(each.slave or "?"), str(each.baudrate or "?")] for each in adopted]
    count = f"{len(adopted)} {'sensor' if len(adopted) == 1 else 'sensors'} adopted:"
    return [count, *columns(("name", "id", "baud"), rows, right={1, 2})]


class _Repeating:
    """What is asked and told, until it is cancelled."""

    def __init__(self, visitor: CommandClient, mounting: AdoptLoop, *, as_json: bool) -> None:
        self._visitor = visitor
        self._mounting = mounting
        self._as_json = as_json

    async def go_on(self) -> bool:
        """Adopt one after the other; whether nothing stopped it."""
        async with spinning(f"{ADOPT} ..."):
            await self._visitor.enter()
            await self._visitor.find_daemon()
            await self._look()
        self._say(FIRST)
        while not self._mounting.complete:
            try:
                if not await self._turn():
                    return False
            except BrokerError as error:
                self._mounting.lost()
                self._say(f"{error}; waiting until it is there again", trouble=True)
                async with spinning(WORDS):
                    await self._visitor.come_back()
                self._say("It is there again.", trouble=True)
        return True

    async def _turn(self) -> bool:
        """Ask once; whether it can go on."""
        mounting = self._mounting
        async with spinning(WORDS):
            if mounting.doubtful and await self._look():
                return True
            response = await self._visitor.ask(ADOPT, self._identified(mounting.content), None)
            turn = mounting.heard(response or {})
        if turn.adopted is not None:
            self._tell(turn.adopted)
        if turn.trouble is not None:
            self._say(turn.trouble, trouble=True)
        if turn.ends:
            return False
        async with spinning(WORDS):
            await asyncio.sleep(turn.pause)
        return True

    async def _look(self) -> bool:
        """Ask how the daemon is; whether that shows a sensor that was adopted meanwhile."""
        response = await self._visitor.ask("health", self._identified({}, always=True), HEALTH_WITHIN)
        if response is None:
            raise FailedError(f"no response to health within {HEALTH_WITHIN:g} s")
        found = list(self._mounting.looked(response.get("data")))
        for each in found:
            self._tell(each)
        return bool(found)

    def _identified(self, content: dict[str, Any], *, always: bool = False) -> dict[str, Any]:
        """Return a request's content, with an id only where its answer is told by nothing else.

        The daemon keeps the answer to each id on its disk for a day: too much for a question asked every few seconds.
        """
        if self._visitor.by_response_topic and not always:
            return content
        return {**content, "id": secrets.token_hex(6)}

    def _tell(self, adopted: AdoptedSensor) -> None:
        if self._as_json:
            click.echo(json.dumps(adopted.data))
        else:
            self._say(adopted.words)
        if not self._mounting.complete:
            self._say(NEXT)

    def _say(self, words: str, *, trouble: bool = False) -> None:
        click.echo(words, err=trouble or self._as_json)
