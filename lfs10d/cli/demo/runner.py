"""Runs the demo: starts its processes, shows the live view of `lfs10d watch`, ends everything."""

from __future__ import annotations

import asyncio
import select
import signal
import time
from collections.abc import Coroutine
from contextlib import suppress
from typing import Final

import click

from lfs10d.cli.demo import texts
from lfs10d.cli.demo.broker import Broker, start_broker
from lfs10d.cli.demo.page import Page, begin_page, finish_page
from lfs10d.cli.demo.processes import DAEMON, PYTHON, Children, temporary_folder
from lfs10d.cli.demo.scenario import BAUDRATE, LINE, configuration, faults, slaves
from lfs10d.cli.login import log_in
from lfs10d.cli.render.live_state import LiveState
from lfs10d.cli.render.live_view import live_view
from lfs10d.cli.render.spinner import spinning
from lfs10d.cli.watch import Watch
from lfs10d.errors import FailedError

STANDARD_OUTPUT: Final = 1


async def show(*, duration: float | None, wanted: str) -> None:
    """Run the demo for `duration` in seconds (None: on and on), or until Ctrl-C, SIGTERM or the terminal's end.

    `wanted` is the broker: auto, mosquitto or amqtt. Raises FailedError if a part of it cannot be started, or ends.
    """
    over = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, over.set)
    begun = time.monotonic()
    last = LiveState(LINE)
    with temporary_folder() as folder:
        children = Children(folder)

        def may_draw() -> bool:
            children.check()
            return _is_writable()

        async def play() -> None:
            nonlocal last
            async with spinning("starting the simulated line, the broker and the daemon ..."):
                watch, broker, page = await _start(children, wanted)
            last = watch.live
            try:
                with suppress(TimeoutError):
                    async with asyncio.timeout(duration):
                        await watch.show(live_view(remarks=texts.remarks(broker, page)), may_draw)
            finally:
                await watch.disconnect()

        try:
            await _until(over, play())
        finally:
            await children.end()
    with suppress(OSError):  # the terminal may be gone
        if _is_writable():
            click.echo(texts.summary(last, time.monotonic() - begun))


async def _until(over: asyncio.Event, play: Coroutine[None, None, None]) -> None:
    """Show the demo to its end, or until `over`."""
    playing, ending = asyncio.ensure_future(play), asyncio.ensure_future(over.wait())
    await asyncio.wait({playing, ending}, return_when=asyncio.FIRST_COMPLETED)
    if not ending.done():
        ending.cancel()
        await playing
        return
    playing.cancel()
    with suppress(asyncio.CancelledError, OSError):  # OSError: the terminal may be gone
        await playing


async def _start(children: Children, wanted: str) -> tuple[Watch, Broker, Page | None]:
    """Start line, broker, page and daemon; return the connected view of the daemon, the broker and the page."""
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
    page = begin_page(children, configuration_file)
    daemon = children.start(DAEMON, *ours, "run", "-c", str(configuration_file), "--state-dir", str(children.folder))
    watch = Watch(log_in(configuration_file, "demo", username=None, password_file=None))
    await watch.connect()
    if not await children.ready(daemon, lambda: watch.online):
        await watch.disconnect()
        raise FailedError(f"the demo's daemon does not start: {daemon.last_words()}")
    return watch, broker, await finish_page(children, page)


def _is_writable() -> bool:
    """Return whether a write would return at once: a stopped terminal or pager must not block the demo."""
    return bool(select.select([], [STANDARD_OUTPUT], [], 0)[1])
