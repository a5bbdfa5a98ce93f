"""Home Assistant's discovery at a broker that notes what it is told, in virtual time."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, cast

import pytest

from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.discovery import TAKEN_IN, Discovery
from lfs10d.mqtt.messages import Filter, Incoming
from lfs10d.mqtt.topics import Topics
from lfs10d.telemetry.homeassistant.search import QUIET
from lfs10d.telemetry.publication import Publication
from tests.support.virtual_loop import Loop

LINE = "homeassistant/device/lfs10d_lfs10d_a/config"
MAST = "homeassistant/device/lfs10d_lfs10d_a_mast/config"
OLD = "homeassistant/device/lfs10d_lfs10d_a_old/config"
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


@pytest.fixture
def site() -> Iterator[Site]:
    """Give a site."""
    made = Site()
    yield made
    made.loop.close()


def test_all_is_announced_after_each_connect_once_the_broker_was_asked(site: Site) -> None:
    wanted = {LINE: payload("load"), MAST: payload("wind")}
    site.configure(wanted)
    site.do(lambda: site.discovery.begin(cast("Connection", site)))
    assert site.subscribed == [ALL, STATUS]
    assert site.news() == []
    site.wait(QUIET)
    assert site.news() == list(wanted.items())
    assert site.unsubscribed == [ALL]

    site.do(site.discovery.lost)
    site.connect(*wanted.items())
    assert site.news() == list(wanted.items())


def test_a_change_is_published_and_nothing_else(site: Site) -> None:
    site.configure({LINE: payload("load"), MAST: payload("wind")})
    site.connect()
    site.news()
    site.configure({LINE: payload("load"), MAST: payload("wind", qos=1)})
    assert site.news() == [(MAST, payload("wind", qos=1))]
    site.configure({LINE: payload("load")})
    assert site.news() == [(MAST, None)]
    site.configure({LINE: payload("load")})
    assert site.news() == []


def test_a_single_entity_is_removed_in_two_steps(site: Site) -> None:
    site.configure({LINE: payload("load", "scan")})
    site.connect()
    site.news()
    site.configure({LINE: payload("load")})
    ((topic, stub),) = site.news()
    assert (topic, stub["components"]["scan"]) == (LINE, {"platform": "sensor"})
    site.out = False
    site.wait(TAKEN_IN)
    assert site.news() == []  # the broker has not got it yet
    site.out = True
    site.wait(TAKEN_IN)
    assert site.news() == [(LINE, payload("load"))]
    site.wait(100)
    assert site.news() == []


def test_an_entity_that_comes_back_meanwhile_stays(site: Site) -> None:
    both = payload("load", "scan")
    site.configure({LINE: both})
    site.connect()
    site.configure({LINE: payload("load")})
    site.news()
    site.configure({LINE: both})
    assert site.news() == [(LINE, both)]
    site.wait(10 * TAKEN_IN)
    assert site.news() == []


def test_two_removals_in_a_row_are_both_told(site: Site) -> None:
    site.configure({LINE: payload("a", "b", "c")})
    site.connect()
    site.configure({LINE: payload("a", "b")})
    site.configure({LINE: payload("a")})
    stub = site.news()[-1][1]["components"]
    assert (stub["b"], stub["c"]) == ({"platform": "sensor"}, {"platform": "sensor"})
    site.wait(TAKEN_IN)
    assert site.news() == [(LINE, payload("a"))]


def test_what_an_earlier_life_left_is_taken_back(site: Site) -> None:
    site.configure({LINE: payload("load")})
    foreign = {**payload(), "availability": [{"topic": "zigbee2mqtt/bridge/state"}]}
    site.connect((LINE, payload("load", "scan")), (OLD, payload("wind")), ("homeassistant/device/0x1/config", foreign))
    (cleared, (topic, stub)) = site.news()
    assert cleared == (OLD, None)
    assert (topic, stub["components"]["scan"]) == (LINE, {"platform": "sensor"})
    site.wait(TAKEN_IN)
    assert site.news() == [(LINE, payload("load"))]


def test_switched_off_while_it_was_down_all_is_cleared_the_line_last(site: Site) -> None:
    site.remember("homeassistant")
    site.configure({})
    site.connect((LINE, payload("load")))
    assert site.subscribed == [LINE, ALL]  # only where the line is still there the others are looked for
    assert site.news() == []
    for topic in (LINE, MAST):
        site.arrive(topic, json.dumps(payload("x")).encode(), retained=True)
    site.wait(QUIET)
    assert site.news() == [(MAST, None), (LINE, None)]
    assert site.unsubscribed == [LINE, ALL]
    assert site.kept == []

    site.do(site.discovery.lost)
    site.connect()
    assert site.kept == [set()]  # nothing is left: the next connect does not ask
    site.do(site.discovery.lost)
    site.subscribed.clear()
    site.connect()
    assert (site.subscribed, site.news()) == ([], [])


def test_nothing_is_read_or_published_where_it_was_never_on(site: Site) -> None:
    """A broker may end the connection for a subscription that it does not permit."""
    site.remember()
    site.configure({})
    site.connect()
    assert (site.subscribed, site.unsubscribed, site.news(), site.kept) == ([], [], [], [])
    assert site.discovery.republish() == 0


def test_another_prefix_while_it_was_down_clears_what_is_left_under_the_old(site: Site) -> None:
    site.remember("ha", "homeassistant")
    site.configure({LINE: payload("load")})
    old = "ha/device/lfs10d_lfs10d_a/config"
    site.connect()
    assert site.subscribed == [ALL, STATUS, old]
    site.arrive(old, json.dumps(payload("load")).encode(), retained=True)
    site.wait(QUIET)
    assert site.subscribed[-1] == "ha/device/+/config"
    site.arrive(old, json.dumps(payload("load")).encode(), retained=True)
    site.wait(QUIET)
    assert site.news() == [(old, None), (LINE, payload("load"))]
    assert site.kept == []
    site.do(site.discovery.lost)
    site.connect()
    site.wait(QUIET)
    assert site.kept == [{"homeassistant"}]


def test_what_the_broker_does_not_show_is_not_forgotten(site: Site) -> None:
    site.remember("homeassistant")
    site.configure({})
    site.do(lambda: site.discovery.begin(cast("Connection", site)))
    site.do(lambda: site.discovery.subscribed(1, (0x87,)))
    site.wait(100)
    assert site.kept == []


def test_what_is_announced_is_kept_before_it_is_published(site: Site) -> None:
    site.remember()
    site.configure({LINE: payload("load")})
    assert (site.kept, site.news()) == ([{"homeassistant"}], [])


def test_switched_off_and_on_while_connected(site: Site) -> None:
    site.configure({LINE: payload("load"), MAST: payload("wind")})
    site.connect()
    site.news()
    site.configure({})
    assert site.news() == [(MAST, None), (LINE, None)]
    assert site.unsubscribed[-1] == STATUS
    site.wait(QUIET)
    site.configure({LINE: payload("load")})
    assert site.subscribed[-2:] == [ALL, STATUS]
    site.wait(QUIET)
    assert site.news() == [(LINE, payload("load"))]


def test_another_prefix_moves_all(site: Site) -> None:
    site.configure({LINE: payload("load")})
    site.connect()
    site.news()
    site.configure({"ha/device/lfs10d_lfs10d_a/config": payload("load")}, prefix="ha")
    assert site.news() == [(LINE, None)]
    assert site.unsubscribed[-1] == STATUS
    assert site.subscribed[-2:] == ["ha/device/+/config", "ha/status"]
    site.wait(QUIET)
    assert site.subscribed[-1] == LINE  # is nothing left there?
    site.wait(QUIET)
    assert site.news() == [("ha/device/lfs10d_lfs10d_a/config", payload("load"))]


def test_what_goes_while_the_broker_is_away_is_cleared(site: Site) -> None:
    site.configure({LINE: payload("load"), MAST: payload("wind")})
    site.configure({LINE: payload("load")})
    assert site.news() == [(MAST, None)]


def test_home_assistants_birth_message_has_all_announced_anew_soon(site: Site) -> None:
    wanted = {LINE: payload("load"), MAST: payload("wind")}
    site.configure(wanted)
    site.connect()
    site.news()
    for word in (b"offline", b"online", b"online"):
        site.arrive(STATUS, word)
    site.wait(2.4)
    assert site.news() == []
    site.wait(0.2)  # 5 s times the chance of one half
    assert site.news() == list(wanted.items())
    site.wait(100)
    assert site.news() == []


def test_a_birth_message_does_not_forestall_a_removal(site: Site) -> None:
    site.configure({LINE: payload("load", "scan"), MAST: payload("wind")})
    site.connect()
    site.arrive(STATUS, b"online")
    site.wait(2.0)
    site.configure({LINE: payload("load"), MAST: payload("wind")})
    site.news()
    site.wait(0.6)
    assert site.news() == [(MAST, payload("wind"))]
    site.wait(TAKEN_IN)
    assert site.news() == [(LINE, payload("load"))]


def test_a_lost_connection_ends_what_was_under_way(site: Site) -> None:
    site.configure({LINE: payload("load", "scan")})
    site.connect()
    site.arrive(STATUS, b"online")
    site.configure({LINE: payload("load")})
    site.news()
    site.do(site.discovery.lost)
    site.wait(100)
    assert site.news() == []
    assert not site.discovery.on_message(Incoming(MAST, b"{}", retained=True))


def test_a_broker_that_does_not_let_us_look_is_told_all_the_same(site: Site, caplog: pytest.LogCaptureFixture) -> None:
    site.configure({LINE: payload("load")})
    site.do(lambda: site.discovery.begin(cast("Connection", site)))
    site.do(lambda: site.discovery.subscribed(1, (0x87,)))  # another's
    assert site.news() == []
    site.do(lambda: site.discovery.subscribed(2, (0x87, 0x87)))
    assert site.news() == [(LINE, payload("load"))]
    assert [each.levelno for each in caplog.records] == [logging.WARNING] * 2
    assert f"the broker refuses to let us subscribe to {ALL}: not authorized" in caplog.text.lower()
    site.do(lambda: site.discovery.subscribed(2, (0, 0)))
    site.wait(100)
    assert site.news() == []


def test_a_granted_subscription_is_no_news(site: Site, caplog: pytest.LogCaptureFixture) -> None:
    site.configure({LINE: payload("load")})
    site.do(lambda: site.discovery.begin(cast("Connection", site)))
    site.do(lambda: site.discovery.subscribed(2, (0, 1)))
    assert (site.news(), caplog.messages) == ([], [])


def test_a_search_goes_on_while_the_broker_still_sends(site: Site) -> None:
    site.configure({LINE: payload("load")})
    site.do(lambda: site.discovery.begin(cast("Connection", site)))
    site.wait(QUIET - 0.1)
    site.arrive(OLD, json.dumps(payload("wind")).encode(), retained=True)
    site.wait(0.2)
    assert site.news() == []
    site.wait(QUIET)
    assert site.news() == [(OLD, None), (LINE, payload("load"))]


def test_a_live_message_of_another_is_not_taken_for_an_old_one(site: Site) -> None:
    site.configure({LINE: payload("load")})
    site.do(lambda: site.discovery.begin(cast("Connection", site)))
    site.arrive(OLD, json.dumps(payload("wind")).encode())
    site.wait(QUIET)
    assert site.news() == [(LINE, payload("load"))]


def test_without_a_connection_nothing_begins(site: Site) -> None:
    site.configure({LINE: payload("load")})
    site.do(lambda: site.discovery.begin(None))
    site.wait(100)
    assert (site.subscribed, site.news()) == ([], [])
