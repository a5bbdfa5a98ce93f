"""The plain view, for pipes and small terminals: a line of speeds each second, and one for each change."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Final, Self

import click

from lfs10d.cli.demo import texts
from lfs10d.cli.demo.broker import Broker
from lfs10d.cli.demo.state import DemoRow, DemoState

COLUMN: Final = 9
"""With eight sensors and the time a line has 80 characters."""
HEAD_EVERY: Final = 20


class Lines:
    """The text of the plain view; it remembers what it has told."""

    def __init__(self, picture: DemoState) -> None:
        self._picture = picture
        self._told = {name: (row.state, False) for name, row in picture.rows.items()}
        self._since_head = HEAD_EVERY

    def opening(self, broker: Broker) -> Iterator[str]:
        """Yield what is said once."""
        yield f"lfs10d demo: {texts.SUBJECT}"
        yield texts.data_flow(broker)
        for name, story in texts.stories([row.role for row in self._picture.rows.values()]):
            yield f"{name} {story}"
        yield f"Look on: {texts.look_on(broker)}"
        yield texts.FAREWELL

    def turn(self, clock: str) -> Iterator[str]:
        """Yield the changes since the last turn, then the speeds in m/s or what is wrong; `clock` is the time."""
        rows = self._picture.rows.values()
        for row in rows:
            state = (row.state, row.message is not None)
            if state != self._told[row.role.name]:
                self._told[row.role.name] = state
                yield f"{clock} {row.role.name} is {row.state}{f': {row.message}' if row.message else ''}"
        if self._since_head >= HEAD_EVERY:
            self._since_head = 0
            yield "m/s".ljust(len(clock)) + "".join(row.role.name.rjust(COLUMN) for row in rows)
        self._since_head += 1
        yield clock + "".join(_cell(row).rjust(COLUMN) for row in rows)


def _cell(row: DemoRow) -> str:
    if row.speed is not None:
        return f"{row.speed:.2f}"
    return row.fault or "-"


class LinesView:
    """Prints the lines."""

    every: Final = 1.0
    """Seconds from one turn to the next."""

    def __init__(self, picture: DemoState, broker: Broker) -> None:
        self._lines = Lines(picture)
        self._broker = broker

    def __enter__(self) -> Self:
        """Say what is to be seen."""
        for line in self._lines.opening(self._broker):
            click.echo(line)
        return self

    def turn(self) -> None:
        """Print what is known now."""
        for line in self._lines.turn(time.strftime("%H:%M:%S")):
            click.echo(line)

    def __exit__(self, *_: object) -> None:
        """Nothing is to be put right."""
