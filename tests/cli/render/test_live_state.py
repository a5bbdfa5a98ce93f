"""The state of a line as a live view has it, from MQTT."""

from __future__ import annotations

import json
from typing import Any

import pytest

from lfs10d.cli.render.live_state import LATE_AFTER, MOVES_WITHIN, STANDS_OUT, LiveState
from tests.support.live_states import WALL, Heard


def test_devices_are_those_of_the_list_in_its_order() -> None:
    heard = Heard("b", "a")
    heard.tell("devices", [{"name": "c", "id": 9, "label": "C"}, {"name": "b", "id": 3}, "nonsense", {"id": 5}])
    assert [(device.name, device.slave, device.label) for device in heard.live.devices.values()] == [
        ("c", 9, "C"),
        ("b", 3, None),
    ]


def test_what_is_retained_may_come_in_any_order() -> None:
    heard = Heard()
    heard.sample("late", 5.0, leaf="state", old=True)
    heard.tell("device/late/availability", "online", old=True)
    assert heard.live.devices == {}
    heard.tell("devices", [{"name": "late", "id": 4}])
    assert (heard.device("late").value, heard.device("late").online) == (5.0, True)


def test_nothing_is_known_before_a_list_of_devices() -> None:
    live = LiveState("line0")
    live.on_message("line/state", {"port": "/dev/x"}, old=True, now=0, wall=0)
    assert not live.known
    live.on_message("devices", [], old=True, now=0, wall=0)
    assert live.known


def test_a_good_sample_shows_its_value_unit_and_time_of_answer() -> None:
    heard = Heard("a")
    heard.sample("a", 12.5)
    device = heard.device("a")
    assert (device.good, device.value, device.unit, device.rtt_ms, device.error) == (True, 12.5, "m/s", 18.2, None)
    assert device.units == {"wind_speed": "m/s"}


def test_of_several_values_each_has_its_unit_and_the_first_counts() -> None:
    heard = Heard("a")
    values = {"speed": 1450, "current": 1.5, "units": {"speed": "rpm", "current": "A"}}
    heard.tell("device/a/telemetry", {"seq": 1, "boot": "x", "ts": 1, "quality": "good", **values})
    assert (heard.device("a").values, heard.device("a").unit) == ({"speed": 1450, "current": 1.5}, "rpm")


def test_of_a_partial_sample_the_first_number_counts_and_what_is_missing_is_told() -> None:
    heard = Heard("a")
    values = {"sky": "rain", "wet": True, "speed": None, "current": 1.5, "odd": [1], "units": {"current": "A"}}
    partial = {"quality": "partial", "errors": {"speed": "unavailable", "odd": 7}}
    heard.tell("device/a/telemetry", {"seq": 1, "boot": "x", "ts": 1, **partial, **values})
    device = heard.device("a")
    assert device.values == {"sky": "rain", "wet": True, "current": 1.5}
    assert (device.good, device.value, device.unit, device.errors) == (True, 1.5, "A", {"speed": "unavailable"})
    heard.tell("device/a/telemetry", {"seq": 2, "boot": "x", "ts": 2, **partial, **values, "quality": "bad"})
    assert heard.device("a").errors == {}


def test_a_bad_sample_takes_the_value_away_and_the_age_goes_on() -> None:
    heard = Heard("a")
    heard.sample("a", 12.5)
    heard.now += 4
    heard.sample("a", None)
    assert (heard.device("a").value, heard.device("a").error) == (None, "timeout")
    assert heard.age("a") == pytest.approx(4.0)


def test_a_state_that_telemetry_has_told_already_is_passed_over() -> None:
    heard = Heard("a")
    heard.sample("a", 1.0)
    heard.sample("a", 2.0)
    heard.sample("a", 1.0, leaf="state", seq=1)
    assert heard.device("a").value == 2.0


def test_another_life_of_the_daemon_begins_to_count_anew() -> None:
    heard = Heard("a")
    heard.sample("a", 1.0, seq=500)
    heard.sample("a", 2.0, seq=1, boot="bbbbbbbb")
    assert heard.device("a").value == 2.0


@pytest.mark.parametrize("ahead", [-3600.0, -2.0, 0.0, 2.0, 86_400.0])
def test_ages_are_right_whatever_our_own_clock_says(ahead: float) -> None:
    heard = Heard("a", ahead=ahead)
    heard.sample("a", 1.0)
    heard.now += 7.5
    assert heard.age("a") == pytest.approx(7.5)


def test_the_age_of_a_retained_value_is_told_by_its_time_stamp() -> None:
    heard = Heard("a")
    heard.sample("a", 1.0, leaf="state", old=True, ts=round((WALL + heard.now - 600) * 1000))
    assert heard.age("a") == pytest.approx(600)
    assert heard.live.late(heard.device("a"), heard.wall)


def test_of_a_device_that_fails_the_statistics_tell_the_last_good_value() -> None:
    heard = Heard("a", "b")
    heard.sample("a", None, leaf="state", old=True)
    heard.tell("device/a/stats", {"last_good_ts": round((WALL + heard.now - 50) * 1000)}, old=True)
    assert heard.age("a") == pytest.approx(50)
    heard.tell("device/a/stats", {"last_good_ts": round((WALL + heard.now - 90) * 1000)})
    heard.tell("device/a/stats", {"last_good_ts": None})
    assert heard.age("a") == pytest.approx(50)
    assert heard.age("b") is None


@pytest.mark.parametrize("statistics_first", [False, True])
def test_a_device_not_polled_yet_has_no_value_since_the_start_but_perhaps_one_before(statistics_first: bool) -> None:  # noqa: FBT001 - a case
    heard = Heard("a")
    stats = {"last_good_ts": round((WALL + heard.now) * 1000)}
    if statistics_first:
        heard.tell("device/a/stats", stats)
    heard.sample("a", None, leaf="state", error="starting")
    heard.tell("device/a/stats", stats)
    assert heard.age("a") is None
    heard.sample("a", 5.0)
    assert heard.age("a") == 0.0
    heard.now += 30
    heard.sample("a", None, leaf="state", error="starting", boot="cccccccc")
    assert heard.age("a") == pytest.approx(30)


@pytest.mark.parametrize("interval", [0.25, 1.0, 3600.0])
def test_a_value_is_late_three_intervals_and_three_seconds_after_it_came(interval: float) -> None:
    heard = Heard()
    heard.tell("devices", [{"name": "a", "interval": interval}])
    heard.sample("a", 1.0)
    heard.now += 3 * interval + LATE_AFTER - 0.01
    assert not heard.live.late(heard.device("a"), heard.wall)
    heard.now += 0.02
    assert heard.live.late(heard.device("a"), heard.wall)


def test_a_sample_that_a_request_wanted_of_a_disabled_device_is_not_shown() -> None:
    heard = Heard()
    heard.tell("devices", [{"name": "a", "enabled": False}])
    heard.sample("a", None, error="disabled", leaf="state", old=True)
    heard.sample("a", 5.0)
    assert (heard.device("a").value, heard.device("a").error) == (None, "disabled")


def test_that_a_device_came_or_went_is_known_only_if_it_happened_before_our_eyes() -> None:
    heard = Heard("a")
    heard.tell("device/a/availability", "online", old=True)
    assert heard.device("a").turned is None
    heard.tell("device/a/availability", "online")
    assert heard.device("a").turned is None
    heard.tell("device/a/availability", "offline")
    assert heard.device("a").turned == (heard.now, False)


# Who moved


def spin(heard: Heard, seconds: float, **values: tuple[float, float]) -> None:
    """Let values alternate between two, four times a second."""
    for step in range(round(seconds * 4)):
        heard.now += 0.25
        for name, pair in values.items():
            heard.sample(name, pair[step % 2])


def test_the_one_whose_cup_is_spun_is_marked() -> None:
    heard = Heard("a", "b", "c")
    spin(heard, 4, a=(6.0, 7.0), b=(0.5, 4.0), c=(5.5, 6.0))
    assert heard.moved == ["b"]


def test_where_all_move_alike_nobody_is_marked() -> None:
    heard = Heard("a", "b")
    spin(heard, 4, a=(6.0, 7.0), b=(6.0, 7.0 * STANDS_OUT / 3))
    assert heard.moved == []


def test_where_nothing_moves_nobody_is_marked() -> None:
    heard = Heard("a", "b")
    spin(heard, 4, a=(6.0, 6.0), b=(0.0, 0.0))
    assert heard.moved == []


def test_a_movement_is_forgotten_after_three_seconds() -> None:
    heard = Heard("a")
    spin(heard, 1, a=(1.0, 5.0))
    assert heard.moved == ["a"]
    heard.now += MOVES_WITHIN + 0.01
    assert heard.moved == []


def test_retained_values_are_no_movement_and_one_that_fails_now_is_not_marked() -> None:
    heard = Heard("a", "b")
    heard.sample("a", 1.0, old=True)
    heard.sample("a", 9.0)
    spin(heard, 1, b=(1.0, 5.0))
    heard.sample("b", None)
    assert heard.moved == []


def test_each_unit_has_a_mark_of_its_own() -> None:
    heard = Heard("wind", "fan")
    for step in range(8):
        heard.now += 0.25
        heard.sample("wind", float(step % 2))
        heard.sample("fan", 1000.0 + 50 * (step % 2), unit="rpm")
    assert heard.moved == ["wind", "fan"]


def test_a_message_is_kept_as_plain_data() -> None:
    heard = Heard("a")
    heard.tell("line/state", json.loads('{"port":"/dev/x"}'))
    heard.tell("line/stats", {"load_pct": 12.5})
    heard.tell("line/error", {"active": True, "code": "port_busy"})
    assert heard.live.line == {"port": "/dev/x", "load_pct": 12.5}
    assert heard.live.line_error == "port_busy"
    heard.tell("line/error", {"active": False, "code": None})
    assert heard.live.line_error is None


def test_since_when_a_device_and_the_line_fail_is_known_from_their_errors() -> None:
    heard = Heard("a")
    assert (heard.device("a").since, heard.live.line_error_since) == (None, None)
    raised = {"active": True, "code": "timeout", "message": "no answer in 200 ms", "since": 1_795_298_000_000}
    heard.tell("device/a/error", raised)
    heard.tell("line/error", {**raised, "code": "port_lost"})
    assert heard.device("a").since == heard.live.line_error_since == 1_795_298_000_000
    assert (heard.live.line_error_code, heard.live.line_error) == ("port_lost", "no answer in 200 ms")
    cleared = {"active": False, "code": None, "last_code": "timeout", "cleared": 1}
    heard.tell("device/a/error", cleared)
    heard.tell("line/error", cleared)
    now = heard.live
    assert [heard.device("a").since, now.line_error_since, now.line_error_code, now.line_error] == [None] * 4


# For the page


def test_the_mark_of_a_device_changes_with_each_newer_sample_and_each_start_of_the_daemon() -> None:
    heard = Heard("a")
    assert heard.live.mark("a") == ("", -1)
    heard.sample("a", 1.0)
    assert heard.live.mark("a") == ("aaaaaaaa", 1)
    heard.sample("a", 1.0, leaf="state", seq=1)
    assert heard.live.mark("a") == ("aaaaaaaa", 1), "the same sample once more"
    heard.sample("a", 2.0, seq=1, boot="bbbbbbbb")
    assert heard.live.mark("a") == ("bbbbbbbb", 1)
    assert heard.live.mark("unknown") == ("", -1)


@pytest.mark.parametrize("ahead", [-30.0, 0.0, 2.5])
def test_how_far_our_clock_is_ahead_is_learned_from_samples(ahead: float) -> None:
    heard = Heard("a", ahead=ahead)
    heard.sample("a", 1.0)
    assert heard.live.ahead == pytest.approx(ahead, abs=0.001)


@pytest.mark.parametrize(
    ("sample", "value"),
    [
        ({"seq": 7, "ts": 1, "wind_speed": 4.5, "unit": "m/s", "rtt_ms": 18.2}, 4.5),
        ({"seq": 7, "sky": "rain", "wet": True, "speed": None, "current": 3}, 3),
        ({"seq": 7, "wind_speed": None}, None),
        ({"seq": 7, "values": {"sky": "rain", "wind_speed": 4.5}}, 4.5),
        ({"values": {}, "wind_speed": 4.5}, None),
        ({"count": 10**400, "wind_speed": 4.5}, 4.5),
        ({"count": float("inf"), "wind_speed": 4.5}, 4.5),
    ],
)
def test_the_first_value_of_a_sample_is_its_first_number(sample: dict[str, Any], value: float | None) -> None:
    assert LiveState.first_value(sample) == value
