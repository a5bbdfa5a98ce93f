"""From what the line tells to what the broker is told."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import cast

import pytest

from docs.generate.contract import outbound
from lfs10d.reading import Exchanged, FaultCode, PortChanged, Purpose, UartCounted, UartCounters
from lfs10d.system.clock import Instant
from lfs10d.telemetry.publication import BacklogStats, Payload
from lfs10d.telemetry.station import Station
from tests.support.stations import (
    DAEMON,
    LINE,
    LOST,
    ONE_VALUE,
    THIRD,
    TWO_VALUES,
    WALL,
    fields,
    good,
    instant,
    shown,
    station,
    topics,
)
from tests.support.winds import ANEMOMETER

# -- the burst ----------------------------------------------------------------------------------------------------


def test_a_burst_holds_every_retained_topic_once_and_the_line_before_the_devices() -> None:
    fresh = station()
    burst = fresh.burst(instant(0))
    assert topics(burst) == [
        "info",
        "devices",
        "line/state",
        "line/error",
        "line/stats",
        *(f"device/a/{leaf}" for leaf in ("state", "config", "availability", "error", "stats")),
        *(f"device/b/{leaf}" for leaf in ("state", "config", "availability", "error", "stats")),
    ]
    assert fresh.topics() == set(topics(burst))


def test_retention_and_quality_of_service_are_the_contract_s() -> None:
    running = station()
    published = running.burst(instant(0)) + running.on_event(good("a", 1), instant(1))
    published += running.configure(LINE, [ONE_VALUE], instant(2))
    assert published
    for each in published:
        if each.payload is not None:
            row = outbound(each.topic)
            assert (each.retain, each.qos) == (row.retain, row.qos), each.topic


def test_in_the_first_burst_of_a_boot_every_device_is_starting_without_a_value_or_a_number() -> None:
    fresh = station()
    assert fields(shown(fresh, "device/b/state"), "output_current", "speed", "quality", "error", "seq") == (
        None,
        None,
        "bad",
        "starting",
        0,
    )
    assert shown(fresh, "device/b/availability") == "offline"
    assert fields(shown(fresh, "line/state"), "open", "activity", "requests") == (False, "polling", "ok")


def test_a_later_burst_shows_the_newest_sample() -> None:
    running = station()
    running.on_event(good("a", 1), instant(1))
    running.on_event(good("a", 1.1), instant(1.1))
    assert fields(shown(running, "device/a/state", 1.2), "seq", "wind_speed") == (2, 12.34)


def test_devices_are_listed_in_the_order_of_the_file() -> None:
    assert shown(station(TWO_VALUES, ONE_VALUE), "devices") == [TWO_VALUES.entry(), ONE_VALUE.entry()]


# -- readings -----------------------------------------------------------------------------------------------------


def test_every_device_counts_its_own_samples_from_one() -> None:
    running = station()
    numbers = [
        (each.sample.device, each.sample.seq)
        for device in ("a", "b", "a", "a", "b")
        for each in running.on_event(good(device, 1), instant(1))
        if each.sample is not None
    ]
    assert numbers == [("a", 1), ("b", 1), ("a", 2), ("a", 3), ("b", 2)]


def test_a_sample_is_dated_when_its_answer_ended_not_when_it_is_published() -> None:
    published = station().on_event(good("a", 1.25), instant(1.5))
    assert fields(published[0].payload, "ts") == (round((WALL + 1.25) * 1000),)


@pytest.mark.parametrize("device", ["gone", "c"])
def test_a_reading_of_a_device_unknown_or_disabled_is_passed_over(device: str) -> None:
    running = station(ONE_VALUE, replace(THIRD, enabled=False))
    assert running.on_event(good(device, 1), instant(1)) == []
    assert fields(shown(running, "line/stats", 10), "polls_per_s") == (0.0,)


def test_an_exchange_changes_figures_alone() -> None:
    running = station()
    happened = Exchanged(1.0, 0.9, 0.9, 0.004, 2, Purpose.POLL, None, b"", b"", unsolicited=3)
    assert running.on_event(happened, instant(1)) == []
    assert fields(shown(running, "line/stats", 10), "exchanges", "unsolicited_bytes") == (1, 3)


def test_the_driver_s_counters_are_passed_on() -> None:
    running = station()
    assert running.on_event(UartCounted(1, UartCounters(4, 3, 2, 1)), instant(1)) == []
    assert fields(shown(running, "line/stats"), "uart") == ({"framing": 4, "parity": 3, "overrun": 2, "break": 1},)


def test_an_overrun_is_counted_and_never_raised() -> None:
    running = station()
    published = running.on_event(replace(good("a", 1), overruns=4), instant(1))
    assert "device/a/error" not in topics(published)
    assert fields(shown(running, "line/stats"), "errors") == ({"overrun": 4},)
    assert fields(shown(running, "device/a/stats"), "errors") == ({"overrun": 4},)


def test_the_cycle_is_measured_per_device() -> None:
    running = station()
    for device, at in (("a", 1.0), ("b", 1.4), ("a", 1.5), ("b", 2.2)):
        running.on_event(good(device, at), instant(at))
    assert fields(shown(running, "line/stats", 3), "cycle_s") == (0.8,)


# -- other facts --------------------------------------------------------------------------------------------------


def test_what_the_line_is_busy_with_is_told_once() -> None:
    running = station()
    assert topics(running.on_activity("scanning", instant(1))) == ["line/state"]
    assert running.on_activity("scanning", instant(2)) == []
    assert fields(shown(running, "line/state"), "activity") == ("scanning",)


def test_refused_requests_are_told_once() -> None:
    running = station()
    assert running.on_requests("ok", instant(1)) == []
    assert topics(running.on_requests("denied", instant(1))) == ["line/state"]
    assert fields(shown(running, "line/state"), "requests") == ("denied",)


def test_new_facts_about_the_daemon_are_told_once() -> None:
    running = station()
    newer = replace(DAEMON, mqtt={"version": "3.1.1"}, changes=3)
    assert running.introduce(DAEMON, instant(1)) == []
    assert topics(running.introduce(newer, instant(1))) == ["info"]
    assert fields(shown(running, "info"), "mqtt", "changes") == ({"version": "3.1.1"}, 3)


def test_errors_from_elsewhere_are_errors_of_the_line() -> None:
    running = station()
    assert topics(running.set_line_error(FaultCode.STORAGE_FULL, "disk full", instant(1))) == ["line/error"]
    assert running.set_line_error(FaultCode.STORAGE_FULL, "disk full", instant(2)) == []
    assert fields(shown(running, "line/error"), "code", "count") == ("storage_full", 2)
    assert topics(running.set_line_error(FaultCode.STORAGE_FULL, None, instant(3))) == ["line/error"]
    assert running.set_line_error(FaultCode.STORAGE_FULL, None, instant(4)) == []


def test_when_the_clock_is_set_the_start_is_told_by_it() -> None:
    running = Station(DAEMON, LINE, [ONE_VALUE], Instant(0, 1000.0, "unsynced"))
    assert fields(shown_by(running, Instant(1, 1001.0, "unsynced")), "started", "clock") == (
        1_000_000,
        "unsynced",
    )
    published = running.tick(instant(5))
    assert topics(published) == ["info"]
    assert fields(published[0].payload, "started", "clock") == (round(WALL * 1000), "synced")
    assert running.tick(instant(6)) == []


def shown_by(of: Station, now: Instant) -> Payload:
    return of.burst(now)[0].payload


# -- time ---------------------------------------------------------------------------------------------------------


def test_statistics_come_every_half_minute_and_are_not_made_up_for_a_sleep() -> None:
    running = station()
    due = running.due()
    assert due == 30.0
    assert running.tick(instant(29.999)) == []
    expected = ["line/stats", "device/a/stats", "device/b/stats"]
    assert topics(running.tick(instant(30.01))) == expected
    assert running.due() == 60.0
    assert topics(running.tick(instant(1000))) == expected
    assert running.due() == 1030.0
    assert running.tick(instant(1000.1)) == []


def test_statistics_tell_what_waits_for_the_broker() -> None:
    waiting, backlog = Station(DAEMON, LINE, [ONE_VALUE], instant(0)), BacklogStats(7, 5, 2)
    published = [*waiting.tick(instant(30), backlog), *waiting.burst(instant(31), backlog)]
    statistics = [each for each in published if each.topic == "line/stats"]
    assert [fields(each.payload, "store") for each in statistics] == [({"depth": 7, "oldest_ts": 5, "dropped": 2},)] * 2


def test_a_state_that_waits_is_published_when_its_time_comes() -> None:
    running = station()
    for at in (1.0, 1.25, 1.5):
        running.on_event(good("a", at), instant(at))
    running.on_event(good("b", 1.6), instant(1.6))
    running.on_event(good("b", 1.7), instant(1.7))
    assert running.due() == 2.0
    assert running.tick(instant(1.9)) == []
    published = running.tick(instant(2.0))
    assert topics(published) == ["device/a/state"]
    assert fields(published[0].payload, "seq") == (3,)
    assert running.due() == 2.6
    assert topics(running.tick(instant(2.6))) == ["device/b/state"]
    assert running.due() == 30.0


# -- what a live view shows ---------------------------------------------------------------------------------------


def test_a_snapshot_is_plain_json_with_line_and_devices() -> None:
    running = station()
    running.on_event(PortChanged(0, None), instant(0))
    running.on_event(good("a", 1), instant(1))
    running.set_line_error(FaultCode.STORAGE_FULL, "disk full", instant(2))
    snapshot = json.loads(json.dumps(running.snapshot(instant(2)), allow_nan=False))
    assert (snapshot["v"], snapshot["info"]["boot"]) == (1, "k3f9a2c7")
    assert (snapshot["line"]["name"], snapshot["line"]["open"], snapshot["line"]["polls_per_s"]) == (
        "line0",
        True,
        0.5,
    )
    assert snapshot["line"]["error"]["code"] == "storage_full"
    assert [(each["name"], each["online"], each["age_s"]) for each in snapshot["devices"]] == [
        ("a", True, 1.0),
        ("b", False, None),
    ]


def test_a_reading_of_a_disabled_device_is_told_only_if_a_request_wants_it() -> None:
    told = station(replace(ONE_VALUE, enabled=False))
    assert told.on_event(good("a", 1), instant(1)) == []
    assert topics(told.on_event(replace(good("a", 2), requests=(1,)), instant(2))) == ["device/a/telemetry"]


def test_statistics_that_are_due_just_now_are_due_once() -> None:
    running = station()
    assert running.due() == 30
    assert "line/stats" in topics(running.tick(instant(60)))
    assert running.due() == 90


def test_a_snapshot_says_when_it_is_and_since_when_the_daemon_runs() -> None:
    snapshot = station().snapshot(instant(2))
    assert (snapshot["ts"], snapshot["time"]) == (1_795_298_002_000, "2026-11-21T21:53:22.000Z")
    assert fields(snapshot["info"], "started", "clock") == (1_795_298_000_000, "synced")


def test_a_summary_counts_who_is_polled_and_says_how_busy_the_line_is() -> None:
    running = station(ONE_VALUE, TWO_VALUES, replace(THIRD, enabled=False))
    running.on_event(good("a", 0.4), instant(0.4))
    assert running.summary(instant(0.5)) == "1 of 2 slaves online"
    running.on_event(Exchanged(1.5, 0.0, 0.0, None, 2, Purpose.POLL, None, b"", b""), instant(1.5))
    assert running.summary(instant(2)) == "1 of 2 slaves online, line 75 % busy"


def test_what_is_told_late_is_dated_when_it_happened() -> None:
    running = station()
    running.on_event(good("a", 1), instant(5))
    assert fields(shown(running, "device/a/stats", 5), "last_good_ts") == (1_795_298_001_000,)
    running.on_event(PortChanged(6, LOST), instant(9))
    assert fields(shown(running, "line/error", 9), "since") == (1_795_298_006_000,)
    running.on_event(PortChanged(10, None), instant(11))
    assert fields(shown(running, "line/error", 11), "cleared") == (1_795_298_011_000,)


def test_everything_that_changes_at_once_is_told() -> None:
    running = station(ONE_VALUE, TWO_VALUES, THIRD)
    told = topics(running.configure(LINE, [replace(THIRD, label="x")], instant(1)))
    assert {"device/a/state", "device/b/state", "device/c/config", "devices"} <= set(told)
    assert told.count("event") == 2


# -- the wind -----------------------------------------------------------------------------------------------------


def test_the_wind_of_a_device_is_in_every_burst_among_the_topics_and_in_the_snapshot() -> None:
    running = station(ANEMOMETER, TWO_VALUES)
    assert topics(running.burst(instant(0))).count("device/a/wind") == 1
    assert running.topics() == set(topics(running.burst(instant(0))))
    assert "wind" in cast("list[dict[str, object]]", running.snapshot(instant(0))["devices"])[0]
    assert "wind" not in cast("list[dict[str, object]]", running.snapshot(instant(0))["devices"])[1]


def test_the_wind_is_published_by_time_from_readings_as_they_come() -> None:
    running = station(ANEMOMETER)
    for second in range(1, 10):
        assert running.on_event(good("a", second), instant(second))
    assert running.due() <= 10.01
    published = [each for each in running.tick(instant(10.01)) if each.topic == "device/a/wind"]
    assert [fields(each.payload, "samples_10m", "gust_3s") for each in published] == [(9, 12.34)]


def test_a_device_added_shows_its_wind_and_one_that_is_gone_clears_it() -> None:
    running = station(TWO_VALUES)
    added = running.configure(LINE, [TWO_VALUES, ANEMOMETER], instant(1))
    assert topics(added).count("device/a/wind") == 1
    gone = running.configure(LINE, [TWO_VALUES], instant(2))
    assert [each.payload for each in gone if each.topic == "device/a/wind"] == [None]
