"""Runs the demo: starts its processes, listens to the broker, shows what it hears, ends everything."""

from __future__ import annotations

import asyncio
import os
import select
import signal
import sys
import time
from collections.abc import Coroutine
from contextlib import AbstractContextManager, suppress
from typing import Final, Protocol

import click

from lfs10d.cli.demo import texts
from lfs10d.cli.demo.broker import LOOPBACK, Broker, start_broker
from lfs10d.cli.demo.line_view import LinesView
from lfs10d.cli.demo.processes import PYTHON, Children, passing_folder
from lfs10d.cli.demo.scenario import BASE_TOPIC, BAUDRATE, LINE, configuration, faults, slaves
from lfs10d.cli.demo.state import TOPICS, DemoState
from lfs10d.errors import FailedError
from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.messages import Accepted, Filter, Incoming
from lfs10d.mqtt.reasons import Disconnect
from lfs10d.mqtt.settings import BrokerSettings, Version
from lfs10d.mqtt.topics import Topics

STANDARD_OUTPUT: Final = 1


class DemoView(AbstractContextManager["DemoView"], Protocol):
    """What shows the picture between enter and exit."""

    @property
    def every(self) -> float:
        """Seconds from one turn to the next."""

    def turn(self) -> None:
        """Show what is known now."""


class Subscriber:
    """Listens to the broker as any other client would, and passes on to the picture what it hears."""

    def __init__(self, broker: Broker, picture: DemoState) -> None:
        self._picture = picture
        self._topics = Topics.of(BASE_TOPIC, LINE)
        self.gone: str | None = None
        """Why the connection is over."""
        settings = BrokerSettings(LOOPBACK, broker.port, f"lfs10d-demo-{os.getpid()}")
        self._connection = Connection(settings, Version(broker.speaks), self)

    def accepted(self, accepted: Accepted) -> None:
        """Subscribe."""
        del accepted
        self._connection.subscribe([Filter(self._topics.full(topic)) for topic in TOPICS])

    def arrived(self, message: Incoming) -> None:
        """Pass it on."""
        topic = self._topics.relative(message.topic)
        if topic is not None:
            self._picture.heard(topic, message.payload)

    def ended(self, ended: Disconnect) -> None:
        """Note why."""
        self.gone = ended.message

    def acknowledged(self, mid: int, reason: int) -> None:
        """Nothing is published."""

    def subscribed(self, mid: int, reasons: tuple[int, ...]) -> None:
        """Without the subscription the table stays empty, which tells enough."""

    def check(self) -> None:
        """Raise FailedError if the connection is over."""
        if self.gone is not None:
            raise FailedError(f"the demo's view is cut off: {self.gone}")

    def leave(self) -> None:
        """Disconnect."""
        self._connection.leave()


async def show(*, duration: float | None, broker: str) -> None:
    """Run the demo for `duration` in seconds (None: on and on), or until Ctrl-C, SIGTERM or the terminal's end.

    `broker` is auto, mosquitto or amqtt. Raises FailedError if a part of it cannot be started, or ends.
    """
    over = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, over.set)
    picture = DemoState()
    begun = time.monotonic()
    with passing_folder() as folder:
        children = Children(folder)
        try:
            await _until(over, _play(children, picture, broker, duration))
        finally:
            await children.end()
    with suppress(OSError):  # the terminal may be gone
        if _is_taken():
            click.echo(texts.summary(picture, time.monotonic() - begun))


async def _until(over: asyncio.Event, play: Coroutine[None, None, None]) -> None:
    """Play to the end, or until `over`."""
    playing, ending = asyncio.ensure_future(play), asyncio.ensure_future(over.wait())
    await asyncio.wait({playing, ending}, return_when=asyncio.FIRST_COMPLETED)
    if not ending.done():
        ending.cancel()
        await playing
        return
    playing.cancel()
    with suppress(asyncio.CancelledError, OSError):  # OSError: the terminal may be gone
        await playing


async def _play(children: Children, picture: DemoState, wanted: str, duration: float | None) -> None:
    broker = await _start(children, wanted)
    subscriber = Subscriber(broker, picture)
    try:
        with _view(picture, broker) as view, suppress(TimeoutError):
            async with asyncio.timeout(duration):
                while True:
                    await asyncio.sleep(view.every)
                    children.check()
                    subscriber.check()
                    if _is_taken():
                        view.turn()
    finally:
        subscriber.leave()


async def _start(children: Children, wanted: str) -> Broker:
    """Start line, broker and daemon."""
    link, faults_file, configuration_file = (children.folder / name for name in ("line", "faults.yaml", "lfs10d.yaml"))
    ours = (*PYTHON, "-m", "lfs10d")
    faults_file.write_text(faults())
    simulator = children.start(
        "simulator",
        *(*ours, "simulate", "--link", str(link), "--faults", str(faults_file)),
        *("--slaves", slaves(), "--baudrate", str(BAUDRATE)),
    )
    broker = await start_broker(children, wanted)
    if not await children.ready(simulator, link.is_symlink):
        raise FailedError(f"the demo's simulated line does not start: {simulator.last_words()}")
    configuration_file.write_text(configuration(link, broker.port, broker.speaks))
    children.start("daemon", *ours, "run", "-c", str(configuration_file), "--state-dir", str(children.folder))
    return broker


def _view(picture: DemoState, broker: Broker) -> DemoView:
    """Return the table where there is a terminal that can show it, else the lines."""
    if sys.stdout is not None and sys.stdout.isatty():
        from lfs10d.cli.demo.table_view import TableView  # noqa: PLC0415  # a pipe needs nothing to draw with

        table = TableView(picture, broker)
        if table.fits:
            return table
    return LinesView(picture, broker)


def _is_taken() -> bool:
    """Say whether what is written would be taken at once: a stopped terminal or pager must not hold us up."""
    return bool(select.select([], [STANDARD_OUTPUT], [], 0)[1])
