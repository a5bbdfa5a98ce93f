"""What a visitor knows of a line, from MQTT and from the status file."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.cli.render.live_state import LATE_AFTER, MOVES_WITHIN, STANDS_OUT, LiveState, ShownDevice
from lfs10d.cli.render.live_table import DataSource, screen

WALL = 1_795_298_000.0


class Heard:
    """A view from MQTT with a clock; our wall clock is `ahead` s ahead of the daemon's."""

    def __init__(self, *names: str, ahead: float = 0.0) -> None:
        self.live = LiveState("line0")
        self.now = 100.0
        self.ahead = ahead
        self.seqs: dict[str, int] = {}
        self.tell("devices", [{"name": name, "id": 2 + place, "interval": 1.0} for place, name in enumerate(names)])

    @property
    def wall(self) -> float:
        return WALL + self.now + self.ahead

    def tell(self, topic: str, payload: Any, *, old: bool = False) -> None:  # noqa: ANN401 - any JSON
        self.live.on_message(topic, payload, old=old, now=self.now, wall=self.wall)

    def sample(
        self,
        name: str,
        value: float | None,
        *,
        leaf: str = "telemetry",
        old: bool = False,
        **keys: str | float,
    ) -> None:
        self.seqs[name] = self.seqs.get(name, 0) + 1
        sample = {
            "seq": self.seqs[name],
            "boot": "aaaaaaaa",
            "ts": round((WALL + self.now) * 1000),
            "wind_speed": value,
            "unit": "m/s",
            "quality": "bad" if value is None else "good",
            "error": "timeout" if value is None else None,
            "rtt_ms": None if value is None else 18.2,
        }
        self.tell(f"device/{name}/{leaf}", {**sample, **keys}, old=old)

    def device(self, name: str) -> ShownDevice:
        return self.live.devices[name]

    def age(self, name: str) -> float | None:
        return self.live.age(self.device(name), self.wall)

    @property
    def moved(self) -> list[str]:
        return [device.name for device in self.live.movers(self.now)]


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


# The status file


def status(**device: Any) -> dict[str, Any]:  # noqa: ANN401 - any JSON
    return {
        "v": 1,
        "ts": round(WALL * 1000),
        "line": {"name": "line0", "port": "/dev/x", "error": {"active": True, "code": "port_lost", "message": "gone"}},
        "devices": [
            {
                "name": "a",
                "slave": 2,
                "label": "Mast",
                "enabled": True,
                "interval": 1.0,
                "online": True,
                "seq": 5,
                "values": {"wind_speed": 4.5},
                "units": {"wind_speed": "m/s"},
                "quality": "good",
                "error": None,
                "rtt_ms": 18.0,
                "age_s": 0.4,
                **device,
            }
        ],
    }


def test_the_status_file_says_all_that_mqtt_says() -> None:
    live = LiveState("line0")
    live.on_status(status(), now=10.0)
    (device,) = live.devices.values()
    assert (device.name, device.slave, device.label, device.online, device.good) == ("a", 2, "Mast", True, True)
    assert (device.value, device.unit, device.rtt_ms) == (4.5, "m/s", 18.0)
    assert live.age(device, WALL) == pytest.approx(0.4)
    assert (live.line["port"], live.line_error) == ("/dev/x", "gone")


def test_what_moves_and_comes_and_goes_is_seen_in_the_status_file_too() -> None:
    live = LiveState("line0")
    for step, value in enumerate((1.0, 1.0, 6.0)):
        live.on_status(status(values={"wind_speed": value}, seq=step), now=10.0 + step)
    assert [device.name for device in live.movers(12.0)] == ["a"]
    live.on_status(status(online=False), now=13.0)
    assert live.devices["a"].turned == (13.0, False)


def test_the_same_status_read_twice_is_one_sample() -> None:
    live = LiveState("line0")
    for now in (10.0, 10.5, 11.0):
        live.on_status(status(), now=now)
    assert len(live.devices["a"].trail) == 0


def test_a_device_that_never_answered_has_no_age() -> None:
    live = LiveState("line0")
    live.on_status(status(age_s=None, values={"wind_speed": None}, quality="bad", error="timeout"), now=1.0)
    assert live.age(live.devices["a"], WALL) is None


# Anything

ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.just(10**400),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)
LINE_KEYS = ["port", "open", "baudrate", "databits", "parity", "stopbits", "activity", "load_pct", "polls_per_s"]
OTHER_KEYS = ["id", "ts", "boot", "unit", "last_good_ts", "active", "code", "message", "line", "devices"]
KEYS = [*status()["devices"][0], *LINE_KEYS, *OTHER_KEYS]
OBJECTS = st.dictionaries(st.sampled_from(KEYS), ANYTHING | st.just("a"), max_size=8)
TOPICS = ["devices", "info", "line/state", "line/stats", "line/error", "device/a/state", "device/a/telemetry",
          "device/a/stats",
    "device/a/config", "device/a/availability", "device/a", "", "device//state"]  # fmt: skip
MESSAGES = st.tuples(st.sampled_from(TOPICS), ANYTHING | OBJECTS | st.lists(OBJECTS, max_size=2), st.booleans())


@given(st.lists(MESSAGES, max_size=8), OBJECTS)
def test_whatever_comes_in_can_be_shown(messages: list[tuple[str, Any, bool]], written: dict[str, Any]) -> None:
    heard = Heard("a")
    for topic, payload, old in messages:
        heard.tell(topic, payload, old=old)
    file = LiveState("line0")
    file.on_status({**status(), **written}, now=1.0)
    file.on_status({**status(**written), "line": written}, now=2.0)
    for live in (heard.live, file):
        for line in screen(live, DataSource("live", alive=True), (80, 24), now=heard.now, wall=heard.wall):
            text = "".join(piece for piece, _ in line)
            assert text.isprintable()
            assert len(text) <= 80


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


def test_gust_and_mean_are_those_of_the_topic_wind_or_of_the_status() -> None:
    live = LiveState("line0")
    live.on_message("devices", [{"name": "mast", "id": 2}], old=True, now=0.0, wall=0.0)
    live.on_message("device/mast/wind", {"gust_10m": 9.5, "mean_2m": 5.25}, old=True, now=0.0, wall=0.0)
    assert (live.devices["mast"].gust, live.devices["mast"].mean) == (9.5, 5.25)
    live.on_message("device/mast/wind", {"gust_10m": None, "mean_2m": "x"}, old=False, now=1.0, wall=1.0)
    assert (live.devices["mast"].gust, live.devices["mast"].mean) == (None, None)
    status = {"ts": 1000, "devices": [{"name": "mast", "wind": {"gust_10m": 8.0, "mean_2m": 4.0}}, {"name": "fan"}]}
    live.on_status(status, now=2.0)
    assert (live.devices["mast"].gust, live.devices["mast"].mean) == (8.0, 4.0)
    assert live.devices["fan"].gust is None
