"""What an earlier life published is told once, over whichever connection holds, and nothing waits for it for ever."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping, Sequence
from typing import Any, cast

import pytest

from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.messages import Filter, Incoming
from lfs10d.mqtt.retained_reader import RetainedReader
from lfs10d.mqtt.topics import Topics

WANTED = frozenset({"line/state", "device/a/config"})
STATE = Incoming("b/l/line/state", b"s", retained=True)
CONFIG = Incoming("b/l/device/a/config", b"c", retained=True)


class Broker:
    """A connection that notes what it is subscribed to."""

    def __init__(self) -> None:
        self.filters: list[Filter] = []
        self.ended: list[str] = []

    def subscribe(self, filters: Sequence[Filter]) -> int:
        self.filters += filters
        return 7

    def unsubscribe(self, topics: Sequence[str]) -> None:
        self.ended += topics


class Site:
    """One earlier life, what was told of it, and how often the rest went on."""

    def __init__(self, told: Any = None) -> None:  # noqa: ANN401 - a coroutine function in place of our own
        self.told: list[Mapping[str, bytes]] = []
        self.went_on: list[str] = []
        self.go = asyncio.Event()
        self.go.set()
        self.life = RetainedReader(Topics("b/l"), WANTED, told or self._told)

    async def _told(self, found: Mapping[str, bytes]) -> None:
        self.told.append(dict(found))
        await self.go.wait()

    def begin(self, name: str = "first") -> Broker:
        broker = Broker()
        self.life.begin(cast("Connection", broker), lambda: self.went_on.append(name))
        return broker


async def turns() -> None:
    for _ in range(10):
        await asyncio.sleep(0)


def test_what_is_retained_is_told_and_the_subscription_ends() -> None:
    async def scenario() -> None:
        site = Site()
        broker = site.begin()
        await turns()
        assert [(each.topic, each.qos, each.retain_as_published) for each in broker.filters] == [
            ("b/l/line/state", 0, False),
            ("b/l/device/+/config", 0, False),
        ]
        site.life.subscribed(7, (0, 0))
        site.life.arrived(Incoming("b/l/line/state", b"live", retained=False))
        site.life.arrived(STATE)
        await turns()
        assert (site.told, site.life.over, broker.ended) == ([], False, [])
        site.life.arrived(CONFIG)
        await turns()
        assert site.told == [{"line/state": b"s", "device/a/config": b"c"}]
        assert (site.went_on, site.life.over, broker.ended) == (
            ["first"],
            True,
            [each.topic for each in broker.filters],
        )

    asyncio.run(scenario())


def test_a_refused_subscription_tells_that_nothing_is_known() -> None:
    async def scenario() -> None:
        site = Site()
        site.begin()
        await turns()
        site.life.subscribed(8, (0x80, 0x80))
        await turns()
        assert site.told == [], "another subscription's answer"
        site.life.subscribed(7, (0x80, 0x80))
        await turns()
        assert (site.told, site.went_on) == ([{}], ["first"])

    asyncio.run(scenario())


def test_a_connection_lost_meanwhile_is_read_anew_over_the_next() -> None:
    async def scenario() -> None:
        site = Site()
        site.begin("first")
        site.life.lost()
        site.life.arrived(STATE)
        site.begin("second")
        await turns()
        site.life.arrived(STATE)
        site.life.arrived(CONFIG)
        await turns()
        assert (len(site.told), site.went_on) == (1, ["second"])

    asyncio.run(scenario())


def test_what_is_being_told_is_told_once_and_the_next_connection_waits_for_it() -> None:
    async def scenario() -> None:
        site = Site()
        site.go.clear()
        site.begin("first")
        site.life.arrived(STATE)
        site.life.arrived(CONFIG)
        await turns()
        site.life.lost()
        broker = site.begin("second")
        site.go.set()
        await turns()
        assert (len(site.told), site.went_on, broker.filters) == (1, ["second"], [])

    asyncio.run(scenario())


def test_a_mistake_in_what_is_made_of_it_keeps_nobody_offline(caplog: pytest.LogCaptureFixture) -> None:
    async def mistaken(found: Mapping[str, bytes]) -> None:
        raise ZeroDivisionError(len(found))

    async def scenario() -> None:
        site = Site(mistaken)
        site.begin()
        site.life.arrived(STATE)
        site.life.arrived(CONFIG)
        await turns()
        assert (site.went_on, site.life.over) == (["first"], True)

    with caplog.at_level(logging.ERROR):
        asyncio.run(scenario())
    assert "an internal error" in caplog.text
