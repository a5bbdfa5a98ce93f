"""By MQTT 3.1.1 a retained request looks like any other when it is published: so the broker is asked afterwards.

It hides the retain flag from those who are subscribed already (3.1.1, section 3.3.1.3). Such a request runs once. Its
copy at the broker would wait for the next connect: to subscribe anew to the same filter makes the broker send what it
retains, flagged as such (section 3.8.4), which is then rejected and cleared as at a connect.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from lfs10d.mqtt.settings import Version
from lfs10d.mqtt.topics import InboundRequest

ASK_AFTER = 0.5
"""Seconds from a request to the question; those that come meanwhile share it."""


class RetainedRequests:
    """`ask` subscribes to requests once more. Used in the thread of the asyncio loop."""

    def __init__(self, ask: Callable[[], None]) -> None:
        self._ask = ask
        self._timer: asyncio.TimerHandle | None = None

    def received(self, request: InboundRequest, version: Version | None) -> None:
        """Have the broker asked, if this request may be retained there without saying so."""
        if version is Version.V311 and not request.retained and self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(ASK_AFTER, self._due)

    def lost(self) -> None:
        """Note that the connection is gone: at the next the broker sends what it retains by itself."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _due(self) -> None:
        self._timer = None
        self._ask()
