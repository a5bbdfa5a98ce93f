"""The station's shell in virtual time: events and ticks in, publications out to an uplink that notes them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, cast

import pytest

from lfs10d.command import Command
from lfs10d.mqtt.publisher import DUPLICATE_CLIENT, TICK_SLACK, Publisher
from lfs10d.mqtt.uplink import Uplink
from lfs10d.reading import FaultCode
from lfs10d.system.clock import Clock, Instant
from lfs10d.telemetry.publication import BacklogStats, Publication
from lfs10d.telemetry.station import STATS_EVERY
from tests.support.stations import (
    DAEMON,
    LINE,
    LINE_TOPICS,
    ONE_VALUE,
    THIRD,
    TWO_VALUES,
    good,
    instant,
    station,
    topics,
)
from tests.support.virtual_loop import Loop


class Announcements:
    """Home Assistant's part of the uplink."""

    def republish(self) -> int:
        """Return how many topics are published once more."""
        return 3


class NotedUplink:
    """An uplink without a broker; `published` is what it was given."""

    def __init__(self) -> None:
        self.published: list[Publication] = []
        self.republished = 0
        self.backlog = BacklogStats(depth=4, dropped=2)
        self.connected = True
        self.version: str | None = None
        self.requests_denied = False
        self.duplicate = False
        self.summary = "broker connected"
        self.discovery = Announcements()

    def publish(self, publications: Iterable[Publication]) -> None:
        """Take publications."""
        self.published += publications

    def republish(self) -> None:
        """Take that all is to be published once more."""
        self.republished += 1

    def taken(self) -> list[Publication]:
        """Return what was published since the last call."""
        published, self.published = self.published, []
        return published


class Bench:
    """A publisher in virtual time, before the broker has the first burst."""

    def __init__(self, loop: Loop) -> None:
        self.loop = loop
        self.uplink = NotedUplink()
        self.publisher = loop.run_until_complete(self._built())

    async def _built(self) -> Publisher:
        clock = cast("Clock", self)
        return Publisher(station(ONE_VALUE, TWO_VALUES), DAEMON, cast("Uplink", self.uplink), clock)

    def now(self) -> Instant:
        """Return the moment of the loop's clock."""
        return instant(self.loop.time())

    def epoch_ms(self) -> int:
        """Return the wall clock."""
        return self.now().ts()

    def run(self, seconds: float) -> None:
        """Let so much time pass, timer by timer."""
        end = self.loop.clock.now + seconds
        while self.loop.clock.now < end:
            self.loop.clock.now = min(end, self.loop.clock.now + 0.01)
            self.loop.drain()

    def began(self) -> None:
        """Give the broker the first burst."""
        self.publisher.on_announced()
        self.uplink.taken()


@pytest.fixture
def bench() -> Iterator[Bench]:
    """Give a publisher that has published nothing yet."""
    loop = Loop()
    yield Bench(loop)
    loop.close()


def payload(published: Iterable[Publication], topic: str) -> dict[str, Any]:
    (found,) = [each.payload for each in published if each.topic == topic]
    assert isinstance(found, dict)
    return found


def test_statistics_are_published_by_time_alone_with_what_waits_for_the_broker(bench: Bench) -> None:
    bench.publisher.start()
    bench.run(STATS_EVERY - 0.1)
    assert "line/stats" not in topics(bench.uplink.taken())
    bench.run(0.2)
    assert payload(bench.uplink.taken(), "line/stats")["store"]["depth"] == 4
    bench.run(STATS_EVERY)
    assert topics(bench.uplink.taken()).count("line/stats") == 1


def test_what_becomes_due_sooner_is_published_sooner(bench: Bench) -> None:
    bench.publisher.start()
    bench.began()
    bench.publisher.on_readings([good("a", 0.0)])
    bench.run(0.2)
    bench.publisher.on_readings([good("a", 0.2)])
    assert topics(bench.uplink.taken()).count("device/a/state") == 1
    bench.run(1.0 + TICK_SLACK + 0.02)
    assert topics(bench.uplink.taken()).count("device/a/state") == 1


def test_a_state_that_is_due_is_returned_to_go_with_a_sample(bench: Bench) -> None:
    bench.began()
    bench.publisher.on_readings([good("a", 0.0)])
    bench.run(0.2)
    bench.publisher.on_readings([good("a", 0.2)])
    assert bench.publisher.due(instant(0.5)) == []
    assert topics(bench.publisher.due(instant(1.0))) == ["device/a/state"]


def test_before_the_broker_has_the_first_burst_samples_go_and_states_wait(bench: Bench) -> None:
    bench.publisher.on_readings([good("a", 0.0)])
    assert topics(bench.uplink.taken()) == ["device/a/telemetry"]
    burst = bench.publisher.burst()
    assert payload(burst, "device/a/state")["error"] == "starting"
    assert bench.publisher.topics() == {each.topic for each in burst}
    assert payload(burst, "line/stats")["store"]["depth"] == 4
    bench.publisher.on_announced()
    assert topics(bench.uplink.taken())[0] == "device/a/availability"
    assert payload(bench.publisher.burst(), "device/a/state")["error"] is None


def test_an_event_of_the_line_is_returned_and_not_published(bench: Bench) -> None:
    bench.began()
    assert "device/a/telemetry" in topics(bench.publisher.on_event(good("a", 0.0), instant(0.0)))
    assert bench.uplink.taken() == []


def test_what_a_request_changed_is_an_event_with_its_id(bench: Bench) -> None:
    bench.run(2.0)
    bench.publisher.applied("device/options", Command(id="a1"), device="mast")
    assert payload(bench.uplink.taken(), "event") == {
        "v": 1,
        "type": "change_applied",
        "ts": instant(2.0).ts(),
        "request": "device/options",
        "id": "a1",
        "device": "mast",
    }


def test_a_freed_port_is_the_activity_whatever_else_the_line_does(bench: Bench) -> None:
    def activity() -> list[str]:
        published = [each.payload for each in bench.uplink.taken() if each.topic == "line/state"]
        return [each["activity"] for each in published if isinstance(each, dict)]

    bench.began()
    bench.publisher.act("scan")
    assert activity() == ["scan"]
    bench.publisher.set_paused(paused=True)
    assert activity() == ["paused"]
    bench.publisher.act("scan")
    bench.publisher.act(None)
    assert activity() == []
    bench.publisher.set_paused(paused=False)
    assert activity() == ["polling"]
    bench.publisher.act("scan")
    bench.publisher.act(None)
    assert activity() == ["scan", "polling"]


def test_an_error_of_the_line_is_raised_and_cleared(bench: Bench) -> None:
    bench.began()
    bench.publisher.set_line_error(FaultCode.STORAGE_FULL, "no space left")
    assert payload(bench.uplink.taken(), "line/error")["code"] == "storage_full"
    bench.publisher.set_line_error(FaultCode.STORAGE_FULL, None)
    assert payload(bench.uplink.taken(), "line/error")["code"] is None


def test_other_devices_and_another_fact_of_the_daemon_are_published(bench: Bench) -> None:
    bench.began()
    bench.publisher.configure(LINE, [ONE_VALUE, THIRD])
    (listed,) = [each.payload for each in bench.uplink.taken() if each.topic == "devices"]
    assert isinstance(listed, list)
    assert [each["name"] for each in listed] == ["a", "c"]
    bench.publisher.introduce(version="9.9")
    assert payload(bench.uplink.taken(), "info")["version"] == "9.9"


def test_all_retained_topics_are_published_once_more_and_counted(bench: Bench) -> None:
    everything = len(bench.publisher.topics()) + 1 + 3  # with the availability and Home Assistant's
    assert bench.publisher.republish() == everything
    assert bench.uplink.republished == 1
    assert bench.publisher.topics() >= LINE_TOPICS


def test_how_all_are_is_told_with_the_broker(bench: Bench) -> None:
    health = bench.publisher.health()
    assert health["broker"] == {"connected": True, "depth": 4, "dropped": 2}
    assert {"line", "devices"} <= health.keys()
    assert bench.publisher.summary().endswith(", broker connected")
    assert bench.publisher.summary().startswith("0 of 2 slaves online")


def test_the_uplink_tells_its_version_its_requests_and_a_taken_client_id(bench: Bench) -> None:
    bench.began()
    bench.publisher.on_uplink_change()
    assert bench.uplink.taken() == []
    bench.uplink.version, bench.uplink.requests_denied, bench.uplink.duplicate = "3.1.1", True, True
    bench.publisher.on_uplink_change()
    published = bench.uplink.taken()
    assert payload(published, "info")["mqtt"] == {"version": "3.1.1"}
    assert payload(published, "line/state")["requests"] == "denied"
    error = payload(published, "line/error")
    assert (error["code"], error["message"]) == ("duplicate_client", DUPLICATE_CLIENT)
    bench.uplink.requests_denied = bench.uplink.duplicate = False
    bench.publisher.on_uplink_change()
    published = bench.uplink.taken()
    assert payload(published, "line/state")["requests"] == "ok"
    assert payload(published, "line/error")["code"] is None
