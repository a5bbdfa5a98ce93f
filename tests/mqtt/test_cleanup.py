"""What earlier lives left retained is read over a second connection, so that no sample waits behind it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import cast

import pytest

from lfs10d.mqtt.cleanup import SECOND_CLIENT, Cleanup
from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.messages import Accepted, Events, Filter, Incoming
from lfs10d.mqtt.orphans import AT_ONCE, LONGEST, QUIET
from lfs10d.mqtt.reasons import SESSION_TAKEN_OVER, Disconnect, DisconnectReason
from lfs10d.mqtt.settings import Version
from lfs10d.mqtt.topics import OWNED_LEAVES, Topics
from lfs10d.telemetry.publication import Publication, retained
from tests.support.virtual_loop import Loop

FILTERS = [f"b/l/device/+/{leaf}" for leaf in OWNED_LEAVES]
ACCEPTED = Accepted(Version.V5)
REFUSED = Disconnect(DisconnectReason.REFUSED, "the broker refuses our client id", 0x85)
TAKEN_OVER = Disconnect(DisconnectReason.TAKEN_OVER, "another client", SESSION_TAKEN_OVER)
CLOSED = Disconnect(DisconnectReason.LOST, "closed without a word", by_message=True)
UNPLUGGED = Disconnect(DisconnectReason.LOST, "no answer to a ping")


class Wire:
    """A connection that notes what is done with it."""

    def __init__(self, events: Events | None = None) -> None:
        self.events = events
        self.subscribed: list[str] = []
        self.unsubscribed: list[str] = []
        self.end: str | None = None

    def subscribe(self, filters: Sequence[Filter]) -> int:
        self.subscribed += [each.topic for each in filters]
        return 7

    def unsubscribe(self, topics: Sequence[str]) -> None:
        self.unsubscribed += topics

    def leave(self) -> None:
        self.end = "left"

    def abandon(self) -> None:
        self.end = "abandoned"


class Site:
    """A cleanup in virtual time, whose first connection stands."""

    def __init__(self, loop: Loop) -> None:
        self.loop = loop
        self.owned = {"device/here/state"}
        self.taken: list[bool] = []
        self.parts: list[list[str]] = []
        self.seconds: list[Wire] = []
        self.first = Wire()
        self.cleanup = Cleanup(Topics("b/l"), self._publish, owned=lambda: self.owned, connect=self._connect)

    def _publish(self, clearings: Iterable[Publication]) -> None:
        cleared = list(clearings)
        assert all(each == retained(each.topic, None) for each in cleared)
        self.parts.append([each.topic for each in cleared])

    def _connect(self, events: Events, suffix: str) -> Connection:
        assert suffix == SECOND_CLIENT
        self.seconds.append(Wire(events))
        return cast("Connection", self.seconds[-1])

    @property
    def second(self) -> Events:
        events = self.seconds[-1].events
        assert events is not None
        return events

    @property
    def cleared(self) -> list[str]:
        return [topic for part in self.parts for topic in part]

    def begin(self) -> None:
        self.do(lambda: self.cleanup.begin(cast("Connection", self.first)))

    def do(self, call: Callable[[], object]) -> None:
        """Do this inside the loop, and all that follows at once."""
        self.loop.call_soon(call)
        self.loop.drain()

    def retained(self, *devices: str) -> None:
        for device in devices:
            message = Incoming(f"b/l/device/{device}/state", b"x", retained=True)
            self.do(lambda message=message: self.second.arrived(message))  # type: ignore[misc]  # bound here

    def accepted(self) -> None:
        self.do(lambda: self.second.accepted(ACCEPTED))
        self.do(lambda: self.second.subscribed(7, (0,) * len(FILTERS)))

    def go(self, seconds: float) -> None:
        end = self.loop.clock.now + seconds
        while self.loop.clock.now < end:
            self.loop.clock.now = min(end, self.loop.clock.now + 0.1)
            self.loop.drain()


@pytest.fixture(name="site")
def _site() -> Iterator[Site]:
    loop = Loop()
    try:
        yield Site(loop)
    finally:
        loop.close()


def test_nothing_is_asked_for_over_the_connection_of_the_samples(site: Site) -> None:
    site.begin()
    assert (site.cleanup.under_way, site.cleanup.has_second) == (True, True)
    site.accepted()
    site.retained("gone", "here")
    site.second.acknowledged(1, 0)
    site.go(QUIET)
    assert (site.first.subscribed, site.first.unsubscribed) == ([], [])
    assert site.seconds[0].subscribed == FILTERS
    assert site.seconds[0].end == "left"
    assert (site.cleared, site.cleanup.under_way, site.cleanup.has_second) == (["device/gone/state"], False, False)
    site.second.subscribed(7, ())
    site.retained("late")
    site.second.ended(Disconnect(DisconnectReason.LEFT, "left"))
    site.go(1.0)
    assert (site.cleared, site.first.subscribed) == (["device/gone/state"], []), "what is left counts no more"


def test_thousands_are_cleared_in_parts_between_which_others_have_the_loop(
    site: Site, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    site.begin()
    site.accepted()
    site.retained(*(f"d{number}" for number in range(10 * AT_ONCE)))
    site.go(QUIET)
    assert [len(part) for part in site.parts] == [AT_ONCE] * 10
    assert f"clearing {10 * AT_ONCE} retained topics" in caplog.text


def test_a_broker_that_has_not_answered_the_subscription_is_waited_for(site: Site) -> None:
    site.begin()
    site.do(lambda: site.second.accepted(ACCEPTED))
    site.do(lambda: site.second.subscribed(8, (0,)))
    site.go(LONGEST / 2)
    assert site.cleanup.under_way
    site.go(LONGEST / 2)
    assert not site.cleanup.under_way


def test_where_a_second_connection_is_refused_the_first_does_it(site: Site) -> None:
    site.begin()
    site.do(lambda: site.second.ended(REFUSED))
    assert (site.first.subscribed, site.cleanup.has_second) == (FILTERS, False)
    site.do(lambda: site.cleanup.subscribed(7))
    message = Incoming("b/l/device/gone/state", b"x", retained=True)
    site.do(lambda: site.taken.append(site.cleanup.on_message(message)))
    site.go(QUIET)
    assert site.first.unsubscribed == FILTERS
    assert site.cleared == ["device/gone/state"]
    site.do(lambda: site.taken.append(site.cleanup.on_message(message)))
    assert site.taken == [True, False]


@pytest.mark.parametrize(("ended", "seconds"), [(TAKEN_OVER, 1), (CLOSED, 1), (UNPLUGGED, 2)])
def test_where_the_second_costs_us_the_first_it_is_not_made_again(site: Site, ended: Disconnect, seconds: int) -> None:
    site.begin()
    site.cleanup.lost(ended)
    assert (site.seconds[0].end, site.cleanup.under_way) == ("abandoned", False)
    site.second.ended(UNPLUGGED)
    assert site.first.subscribed == []
    site.begin()
    assert len(site.seconds) == seconds
    assert site.first.subscribed == (FILTERS if seconds == 1 else [])


def test_one_search_at_a_time_and_none_while_the_broker_is_away(site: Site) -> None:
    site.cleanup.wanted = True
    site.cleanup.begin(None)
    assert (site.cleanup.wanted, site.seconds) == (False, [])
    site.begin()
    site.begin()
    assert len(site.seconds) == 1
    site.cleanup.lost(UNPLUGGED)
    site.cleanup.lost(UNPLUGGED)
    site.go(1.0)
    assert site.parts == []
