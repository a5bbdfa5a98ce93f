"""What is said about one device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import cast

from lfs10d.reading import Reading
from lfs10d.telemetry.device_state import DeviceState
from lfs10d.telemetry.publication import PublicationKind
from tests.support.device_states import FACTS, TIMEOUT, Watched, fields, instant, leaves


def test_a_device_is_offline_and_without_a_value_until_its_first_answer() -> None:
    shown = Watched().shown
    assert shown["availability"] == "offline"
    # The contract's new word: `starting` in the state, and in no error topic.
    assert fields(shown["state"], "wind_speed", "quality", "error", "seq") == (None, "bad", "starting", 0)
    assert fields(shown["error"], "active", "code", "last_code") == (False, None, None)


def test_a_device_disabled_from_the_start_says_so_and_has_no_sample() -> None:
    device = DeviceState(replace(FACTS, enabled=False), line="line0", boot="k3f9a2c7", seq=0, now=instant(0))
    state, _, availability, error, _ = device.burst(instant(1.0))
    assert fields(state.payload, "wind_speed", "quality", "error", "seq") == (None, "bad", "disabled", 0)
    assert availability.payload == "offline"
    assert fields(error.payload, "active", "last_code") == (False, None)


def test_the_first_answer_is_available_first_and_shown_at_once() -> None:
    watched = Watched()
    published = watched.publish(0.5, 12.34)
    assert leaves(published) == ["telemetry", "availability", "state"]
    sample, available, state = published
    assert sample.sample is not None
    assert (sample.kind, sample.retain, sample.qos) == (PublicationKind.SAMPLE, False, 1)
    assert sample.sample.payload("line0") == sample.payload
    assert available.payload == "online"
    assert state.payload == sample.payload
    assert fields(state.payload, "seq", "ts", "wind_speed", "rtt_ms") == (1, 1_795_298_000_500, 12.34, 18.2)


def test_a_device_that_goes_shows_no_value_before_it_is_unavailable() -> None:
    watched = Watched()
    watched.poll(0, 1.0)
    assert watched.poll(0.25, TIMEOUT, online=False) == ["telemetry", "state", "availability"]
    assert fields(watched.shown["state"], "wind_speed", "rtt_ms") == (None, None)


def test_disabling_is_one_sample_without_an_error() -> None:
    watched = Watched()
    watched.poll(0, 1.0)
    published = watched.device.reconfigure(replace(FACTS, enabled=False), instant(0.1))
    assert leaves(published) == ["config", "telemetry", "state", "availability"]
    assert fields(published[1].payload, "seq", "error", "quality", "wind_speed", "rtt_ms") == (
        2,
        "disabled",
        "bad",
        None,
        None,
    )
    assert fields(watched.shown["error"], "active") == (False,)
    assert watched.shown["availability"] == "offline"


def test_disabling_an_ailing_device_clears_its_error() -> None:
    watched = Watched()
    watched.poll(0, TIMEOUT)
    watched.poll(1, TIMEOUT)
    published = watched.device.reconfigure(replace(FACTS, enabled=False), instant(2))
    assert leaves(published) == ["config", "telemetry", "state", "error"]


def test_enabling_publishes_the_configuration_alone() -> None:
    watched = Watched()
    watched.device.reconfigure(replace(FACTS, enabled=False), instant(1))
    assert leaves(watched.device.reconfigure(FACTS, instant(2))) == ["config"]


def test_what_is_not_shown_is_not_published() -> None:
    watched = Watched()
    assert watched.device.reconfigure(replace(FACTS, offline_after=1), instant(1)) == []
    assert "error" in watched.poll(2, TIMEOUT)


def test_numbers_go_on_after_a_removal() -> None:
    watched = Watched(seq=41)
    assert fields(watched.shown["state"], "seq") == (0,)
    assert fields(watched.publish(0, 1.0)[0].payload, "seq") == (42,)


def test_each_reading_is_counted_in_the_statistics() -> None:
    watched = Watched()
    watched.publish(1.0, 1.0)
    stats = watched.device.stats(instant(2))
    assert (stats.topic, stats.qos, stats.retain) == ("device/a/stats", 0, True)
    assert fields(stats.payload, "polls", "last_good_ts") == (1, instant(1.0).ts())


def test_the_time_since_the_poll_before_is_returned_with_a_reading() -> None:
    device = Watched().device
    reading = Reading("a", 1.0, {"wind_speed": 1.0}, None, 0.02, online=True, response_timeout=0.2)
    assert device.on_reading(reading, instant(1.0), masked=False)[1] is None
    assert device.on_reading(replace(reading, at=1.5), instant(1.5), masked=False)[1] == 0.5


def test_a_snapshot_tells_how_old_the_last_good_value_is() -> None:
    watched = Watched()
    assert watched.device.snapshot(instant(1))["age_s"] is None
    watched.poll(1, 12.34)
    watched.poll(2, TIMEOUT, online=True)
    snapshot = watched.device.snapshot(instant(4.04))
    assert fields(snapshot, "name", "slave", "label", "online") == ("a", 3, "Mast", True)
    assert fields(snapshot, "values", "quality", "error", "age_s") == (
        {"wind_speed": None},
        "bad",
        "timeout",
        3.0,
    )
    watched.poll(5, 9.5)
    assert fields(watched.device.snapshot(instant(5)), "values", "rtt_ms", "age_s") == (
        {"wind_speed": 9.5},
        18.2,
        0.0,
    )


def test_a_value_is_never_shown_as_unavailable_even_if_the_line_says_so() -> None:
    watched = Watched()
    assert watched.poll(0, 1.0, online=False) == ["telemetry", "availability", "state"]
    assert watched.shown["availability"] == "online"


def test_a_poll_that_a_request_wants_of_a_disabled_device_is_a_numbered_sample_and_nothing_else() -> None:
    watched = Watched()
    watched.device.reconfigure(replace(FACTS, enabled=False), instant(1))
    shown = watched.shown
    stats = shown.pop("stats")
    (sample,) = watched.publish(2, 7.5)
    assert (sample.topic, sample.sample is not None) == ("device/a/telemetry", True)
    assert cast("Mapping[str, object]", sample.payload)["wind_speed"] == 7.5
    assert cast("Mapping[str, object]", sample.payload)["seq"] == 2
    assert watched.poll(3, TIMEOUT) == ["telemetry"]
    now = watched.shown
    assert (fields(stats, "polls"), fields(now.pop("stats"), "polls")) == ((0,), (2,))
    assert now == shown


def test_a_sample_says_whose_it_is_of_which_life_and_by_which_clock() -> None:
    watched = Watched()
    (telemetry, *_) = watched.publish(0.5, 12.34)
    assert telemetry.payload == {
        "v": 1,
        "line": "line0",
        "device": "a",
        "boot": "k3f9a2c7",
        "seq": 1,
        "ts": 1_795_298_000_500,
        "time": "2026-11-21T21:53:20.500Z",
        "clock": "synced",
        "wind_speed": 12.34,
        "unit": "m/s",
        "quality": "good",
        "error": None,
        "rtt_ms": 18.2,
    }


def test_before_the_first_poll_the_state_is_of_the_line_too_and_none_waits() -> None:
    watched = Watched()
    assert fields(watched.shown["state"], "line", "device", "boot") == ("line0", "a", "k3f9a2c7")
    assert (Watched().device.online, Watched().device.state_due) == (False, None)


def test_a_good_reading_without_a_time_of_answer_has_none() -> None:
    device = Watched().device
    reading = Reading("a", 1.0, {"wind_speed": 1.0}, None, None, online=True, response_timeout=0.2)
    assert fields(device.on_reading(reading, instant(1.0), masked=False)[0][0].payload, "rtt_ms") == (None,)


def test_a_disabled_devices_requested_sample_is_of_the_line_too() -> None:
    device = DeviceState(replace(FACTS, enabled=False), line="line0", boot="k3f9a2c7", seq=0, now=instant(0))
    reading = Reading("a", 1.0, {"wind_speed": 1.0}, None, 0.02, online=False, response_timeout=0.2)
    assert fields(device.on_reading(reading, instant(1.0), masked=False)[0][0].payload, "line") == ("line0",)


def test_statistics_have_a_time_and_know_a_fixed_time_out_from_the_start() -> None:
    device = DeviceState(replace(FACTS, response_timeout=0.3), line="line0", boot="b", seq=0, now=instant(0))
    assert fields(device.stats(instant(5.0)).payload, "ts", "response_timeout_ms") == (1_795_298_005_000, 300.0)


def test_the_configuration_is_that_of_the_facts() -> None:
    assert Watched().shown["config"] == FACTS.payload()


def test_a_rest_that_was_learned_is_published_with_the_configuration_once() -> None:
    device = DeviceState(replace(FACTS, request_gap=0.1), line="line0", boot="b", seq=0, now=instant(0))
    rested = Reading("a", 1.0, {"wind_speed": 1.0}, None, 0.02, online=True, response_timeout=0.2, request_gap=0.4)
    told = [leaves(device.on_reading(replace(rested, at=at), instant(at), masked=False)[0]) for at in (1.0, 2.0)]
    assert [("config" in each) for each in told] == [True, False]
    shown = {each.topic: each.payload for each in device.burst(instant(3.0))}
    assert fields(shown["device/a/config"], "request_gap") == (0.4,)
    changed = device.reconfigure(replace(FACTS, request_gap=0.5), instant(4.0))
    assert [fields(each.payload, "request_gap") for each in changed] == [(0.5,)]
    kept = device.reconfigure(replace(FACTS, request_gap=0.5, interval=9.0), instant(5.0))
    assert [fields(each.payload, "request_gap", "interval") for each in kept] == [(0.5, 9.0)]


def test_a_snapshot_tells_everything_a_live_view_shows() -> None:
    watched = Watched()
    watched.publish(0.5, 12.34)
    assert watched.device.snapshot(instant(1.06)) == {
        "name": "a",
        "slave": 3,
        "label": "Mast",
        "profile": "lfs10",
        "enabled": True,
        "interval": 0.25,
        "online": True,
        "seq": 1,
        "ts": 1_795_298_000_500,
        "values": {"wind_speed": 12.34},
        "units": {"wind_speed": "m/s"},
        "quality": "good",
        "error": None,
        "errors": {},
        "ages": {},
        "rtt_ms": 18.2,
        "age_s": 0.6,
        "alarm": {"v": 1, "active": False, "code": None, "last_code": None, "cleared": None},
    }
