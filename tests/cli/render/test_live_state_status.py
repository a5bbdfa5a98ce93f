"""The live state from the status file, and whatever comes in."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.cli.render.live_state import LiveState
from lfs10d.cli.render.live_table import DataSource, screen
from tests.support.live_states import WALL, Heard

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
