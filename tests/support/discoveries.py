"""Home Assistant's discovery at a broker that notes what is published."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, cast

from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.discovery import Discovery
from lfs10d.mqtt.messages import Filter, Incoming
from lfs10d.mqtt.topics import Topics
from lfs10d.telemetry.homeassistant.search import QUIET
from lfs10d.telemetry.publication import Publication
from tests.support.virtual_loop import Loop

LINE = "homeassistant/device/lfs10d_lfs10d_a/config"
MAST = "homeassistant/device/lfs10d_lfs10d_a_mast/config"
ALL = "homeassistant/device/+/config"
STATUS = "homeassistant/status"


def payload(*components: str, **more: object) -> dict[str, object]:
    """Return a payload of the daemon at lfs10d/a with these sensors."""
    return {
        "availability": [{"topic": "lfs10d/a/availability"}],
        "components": {name: {"platform": "sensor", "name": name} for name in components},
        **more,
    }


class Site:
    """A discovery and its broker; `published` are topics and payloads in order."""

    def __init__(self) -> None:
        self.loop = Loop()
        self.published: list[tuple[str, Any]] = []
        self.subscribed: list[str] = []
        self.unsubscribed: list[str] = []
        self.out = True
        self.kept: list[set[str]] = []
        self.discovery = Discovery(Topics("lfs10d/a"), self._publish, is_out=lambda: self.out, chance=lambda: 0.5)

    def remember(self, *prefixes: str) -> None:
        """Take up the life of a daemon that announced something under these prefixes."""
        self.discovery.remember(frozenset(prefixes), lambda kept: self.kept.append(set(kept)))

    def _publish(self, publications: Iterable[Publication]) -> None:
        for each in publications:
            assert each.retain
            assert each.qos == 1
            self.published.append((Topics("lfs10d/a").full(each.topic), each.payload))

    def subscribe(self, filters: Sequence[Filter]) -> int:
        self.subscribed += [each.topic for each in filters]
        return len(self.subscribed)

    def unsubscribe(self, topics: Sequence[str]) -> None:
        self.unsubscribed += topics

    def do(self, action: Callable[[], object]) -> None:
        """Call something in the loop."""
        self.loop.call_soon(action)
        self.loop.drain()

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.loop.clock.now += seconds
        self.loop.drain()

    def configure(self, wanted: Mapping[str, dict[str, object]], prefix: str = "homeassistant") -> None:
        self.do(lambda: self.discovery.configure(prefix, wanted))

    def connect(self, *retained: tuple[str, dict[str, object]]) -> None:
        """Connect to a broker that retains these payloads, and let it tell them."""
        self.do(lambda: self.discovery.begin(cast("Connection", self)))
        for topic, content in retained:
            self.arrive(topic, json.dumps(content).encode(), retained=True)
        self.wait(QUIET + 0.01)

    def arrive(self, topic: str, content: bytes, *, retained: bool = False) -> None:
        self.do(lambda: self.discovery.on_message(Incoming(topic, content, retained=retained)))

    def news(self) -> list[tuple[str, Any]]:
        """Return what was published since it was called before."""
        found, self.published = self.published, []
        return found
