"""The clean exit: sends the queue, then `offline`, then DISCONNECT; within the broker's Receive Maximum."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from lfs10d.mqtt.broker_client import BrokerClient
from lfs10d.outbox.outbox import Outbox
from lfs10d.telemetry.publication import Publication

log = logging.getLogger(__name__)

DRAIN_WITHIN = 0.4
OFFLINE_WITHIN = 0.6
LEAVE_WITHIN = 0.3
"""Seconds of a clean exit: for what still waits, for `offline` to be acknowledged, for the connection to close."""


class CleanExit:
    """Used in the thread of the asyncio loop; `wake()` makes the sender send."""

    def __init__(self, client: BrokerClient, outbox: Outbox, wake: Callable[[], None]) -> None:
        self._client = client
        self._outbox = outbox
        self._wake = wake
        self._progress = asyncio.Event()

    def on_progress(self) -> None:
        """Look again: the broker has acknowledged something, or the connection is lost."""
        self._progress.set()

    async def run(self, last: Publication) -> None:
        """Send what waits, then `last`, and disconnect; at most 1.3 s.

        Where the window has no room for `last` in time, the connection is closed without DISCONNECT: then the broker
        publishes the will.
        """
        loop = asyncio.get_running_loop()
        await self._until(lambda: self._outbox.idle, loop.time() + DRAIN_WITHIN)
        if not self._connected:
            await self._client.leave(LEAVE_WITHIN)
            return
        offline = self._outbox.send_last(last)
        self._wake()
        if await self._until(lambda: offline.over, loop.time() + OFFLINE_WITHIN):
            self._outbox.backlog.on_clean_exit()
        await self._client.leave(LEAVE_WITHIN, will=not offline.sent)

    @property
    def _connected(self) -> bool:
        return self._client.connection is not None

    async def _until(self, reached: Callable[[], bool], deadline: float) -> bool:
        """Wait until the condition holds; return False at the deadline, or if the connection is lost."""
        try:
            async with asyncio.timeout_at(deadline):
                while self._connected and not reached():
                    self._progress.clear()
                    await self._progress.wait()
        except TimeoutError:
            log.debug("the broker does not answer in time")
        return self._connected and reached()
