"""Home Assistant's discovery at a broker that notes what it is told, in virtual time."""

from __future__ import annotations

import json
import logging
from typing import cast

import pytest

from lfs10d.mqtt.connection import Connection
from lfs10d.mqtt.discovery import TAKEN_IN
from lfs10d.mqtt.messages import Incoming
from lfs10d.telemetry.homeassistant.search import QUIET
from tests.support.discoveries import ALL, LINE, MAST, STATUS, Site, payload

OLD = "homeassistant/device/lfs10d_lfs10d_a_old/config"


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
