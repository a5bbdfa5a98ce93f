"""Discovery switched off, on, or to another prefix."""

from __future__ import annotations

import json
from typing import cast

from lfs10d.mqtt.connection import Connection
from lfs10d.telemetry.homeassistant.search import QUIET
from tests.support.discoveries import ALL, LINE, MAST, STATUS, Site, payload


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
