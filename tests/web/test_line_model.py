"""One line as the page shows it."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from lfs10d.web import metrics
from lfs10d.web.line_model import FRAMES_KEPT, MOST_DEVICES, LineModel, Link
from tests.web.lines import PLACE, WALL, PublishedLine, entry, sample


def status(ts: float, seq: int = 7, *, connected: bool = False, value: float | None = 6.5) -> dict[str, Any]:
    """Return what the daemon writes into its status file."""
    return {
        "v": 1, "ts": round(ts * 1000), "info": {"version": "1.0", "boot": "boot0001"},
        "line": {"name": "line0", "port": "/dev/ttyUSB0", "baudrate": 9600, "open": True, "activity": "polling",
                 "error": {"active": True, "code": "port_lost", "message": "gone", "since": 5}},
        "devices": [
            {"name": "mast", "slave": 2, "label": None, "profile": "lfs10", "enabled": True, "interval": 1.0,
             "online": True, "seq": seq, "ts": round(ts * 1000), "values": {"wind_speed": value},
             "units": {"wind_speed": "m/s"}, "quality": "good", "error": None, "rtt_ms": 20.0, "age_s": 0.5,
             "alarm": {"active": False, "code": None}},
            "nonsense",
        ],
        "broker": {"connected": connected, "depth": 42, "dropped": 0},
    }  # fmt: skip


def test_a_sample_is_shown_with_its_value_unit_and_time() -> None:
    line = PublishedLine()
    line.measure(1, 12.5)
    device = line.device
    assert device["values"] == {"wind_speed": 12.5}
    assert device["units"] == {"wind_speed": "m/s"}
    assert device["good_at"] == round(line.wall * 1000)
    assert (device["label"], device["id"], device["profile"], device["quality"]) == ("Mast", 2, "lfs10", "good")


def test_the_age_goes_on_while_polls_fail() -> None:
    line = PublishedLine()
    line.measure(1, 12.5)
    good_at = line.device["good_at"]
    for seq in range(2, 5):
        line.measure(seq, None)
    assert (line.device["values"], line.device["quality"], line.device["error"]) == ({}, "bad", "timeout")
    assert line.device["good_at"] == good_at


def test_times_are_those_of_this_machine_whatever_the_daemons_clock_says() -> None:
    line = PublishedLine()
    line.wall += 1
    line.publish("device/mast/telemetry", sample(1, line.wall - 40_000_000, clock="unsynced"))
    assert line.device["good_at"] == round(line.wall * 1000)
    line.publish("device/mast/telemetry", sample(2, line.wall - 40_000_000 + 8), after=8)
    assert [point[0] for point in line.model.recent("mast")] == [(WALL + 1) // 4 * 4]


def test_the_state_repeats_a_sample_and_is_drawn_once() -> None:
    line = PublishedLine()
    line.publish("device/mast/telemetry", sample(1, line.wall))
    line.publish("device/mast/state", sample(1, line.wall))
    line.publish("device/mast/telemetry", sample(2, line.wall + 8), after=8)
    curve = line.model.curves["mast"]
    assert curve._number[int(WALL // 4) % 900] == 1


def test_failed_polls_are_marked_and_a_start_is_none() -> None:
    line = PublishedLine()
    line.publish("device/mast/state", sample(0, line.wall, None, error="starting"))
    assert "mast" not in line.model.curves
    line.measure(1, None)
    line.measure(2, 5.0, after=8.0)
    assert [point[4] for point in line.model.recent("mast")] == [1]


def test_the_backlog_fills_the_curve_and_is_never_the_newest_value() -> None:
    line = PublishedLine()
    line.measure(100, 3.0, after=600)
    history: list[Any] = [sample(seq, WALL + seq * 4, 9.0, historical=True) for seq in range(10)]
    line.publish("device/mast/history", [*history, "nonsense", {"ts": True}, {"ts": "x"}, {"ts": 2**60}])
    line.publish("device/mast/history", "nonsense")
    assert line.device["values"] == {"wind_speed": 3.0}
    assert len(line.model.recent("mast")) == 10


def test_what_a_device_is_and_does_is_shown_beside_its_value() -> None:
    line = PublishedLine()
    line.measure(1)
    for leaf in ("stats", "config", "wind"):
        line.publish(f"device/mast/{leaf}", {"v": 1, "leaf": leaf})
    line.publish("device/mast/error", {"active": True, "code": "crc", "message": "m", "since": 5, "count": 2})
    line.publish("device/mast/availability", "online")
    line.publish("device/mast/telemetry", sample(2, line.wall, errors={"humidity": "unavailable"}))
    device = line.device
    assert [device[leaf]["leaf"] for leaf in ("stats", "config", "wind")] == ["stats", "config", "wind"]
    assert (device["online"], device["fault"]["code"], device["fault"]["since"]) == (True, "crc", 5)
    assert device["errors"] == {"humidity": "unavailable"}


def test_a_device_that_is_removed_is_forgotten() -> None:
    line = PublishedLine(entry(), entry("roof"))
    line.measure(1, name="roof")
    line.publish("device/roof/stats", {"v": 1})
    line.publish("devices", [entry()])
    assert [name for name, _ in line.model.devices(None, line.wall)] == ["mast"]
    assert (line.model.curves, line.model._mqtt.samples, line.model._mqtt.extras) == ({}, {}, {})


def test_the_line_with_port_error_scan_frames_and_events() -> None:
    line = PublishedLine()
    line.publish("info", {"version": "1.2", "clock": "unsynced"})
    line.publish("line/state", {"port": "/dev/ttyUSB0", "baudrate": 9600, "activity": "scanning", "secret": 1})
    line.publish("line/stats", {"load_pct": 12.0, "store": {"depth": 3}})
    line.publish("line/error", {"active": True, "code": "port_lost", "message": "unplugged", "since": 9})
    line.publish("event", {"type": "scan_progress", "percent": 40, "remaining_s": 9, "baudrate": 9600, "slave": 77})
    line.publish("event", {"type": "readdressed", "device": "mast"})
    for number in range(FRAMES_KEPT + 5):
        line.publish("trace", {"ts": number})
    shown = line.model.summary(line.wall)
    assert shown["info"]["clock"] == "unsynced"
    assert shown["line"] == {
        "port": "/dev/ttyUSB0", "baudrate": 9600, "activity": "scanning", "load_pct": 12.0, "store": {"depth": 3},
    }  # fmt: skip
    assert (shown["error"]["code"], shown["scan"]["percent"], len(shown["events"])) == ("port_lost", 40, 1)
    assert shown["broker"] == {"connected": True, "waiting": 3, "place": PLACE}
    assert (len(line.model.frames), line.model.frames_seen) == (FRAMES_KEPT, FRAMES_KEPT + 5)
    line.publish("line/state", {"activity": "polling"})
    assert line.model.summary(line.wall)["scan"] is None, "a scan that ended has no progress"


@pytest.mark.parametrize(
    ("topic", "payload"),
    [
        ("device/mast/telemetry", "nonsense"), ("device/mast/error", ["x"]), ("device/mast", {}), ("device/a/b/c", {}),
        ("devices", "x"), ("line/state", 7), ("info", []), ("event", 1), ("availability", {"a": 1}), ("", {}),
        ("device/MAST/state", {"v": 1}), ("device/../state", {"v": 1}), ("line/other", {"port": "x"}),
    ],
)  # fmt: skip
def test_what_is_no_message_of_a_daemon_is_ignored(topic: str, payload: object) -> None:
    line = PublishedLine()
    line.measure(1)
    before = (line.device, line.model.summary(line.wall))
    line.publish(topic, payload)
    assert (line.device, line.model.summary(line.wall)) == before


def test_a_flood_of_invented_devices_does_not_grow_without_an_end() -> None:
    line = PublishedLine()
    for number in range(2000):
        line.publish(f"device/invented-{number}/stats", {"v": 1})
    assert len(line.model._mqtt.extras) <= 2 * MOST_DEVICES


def test_without_a_broker_nothing_is_live_and_the_reason_is_told() -> None:
    model = LineModel("line0", "line0", "lfs10d", Link(PLACE))
    assert model.source(WALL).words == f"not live: {PLACE} is away"
    model.link.why = f"{PLACE}: connection refused"
    assert model.source(WALL).words == f"not live: {PLACE}: connection refused"
    model.link.connected = True
    assert "no daemon has published there yet" in model.source(WALL).words
    model.link.daemon = "offline"
    assert "the daemon is offline there" in model.source(WALL).words
    shown = model.summary(WALL)
    assert (shown["known"], shown["order"], shown["error"]) == (False, [], None)
    assert shown["broker"]["connected"] is None


def test_while_the_broker_is_away_the_status_file_is_shown() -> None:
    line = PublishedLine()
    line.measure(1)
    line.publish("device/mast/wind", {"v": 1, "gust_10m": 9.0})
    line.model.summary(line.wall)
    line.model.link.connected = False
    line.model.link.why = "refused"
    for second in range(1, 10):
        line.wall += 1
        line.model.on_status("/run/status.json", status(line.wall, 7 + second), now=float(second))
        line.model.on_status("/run/status.json", status(line.wall, 7 + second), now=float(second))
        line.model.summary(line.wall)
    line.model.on_status("/run/status.json", {**status(line.wall, 16), "ts": round(line.wall * 1000) + 1}, now=10.0)
    shown = line.model.summary(line.wall)
    assert (shown["source"]["kind"], shown["daemon"]) == ("status", None)
    assert shown["source"]["words"] == "live from /run/status.json (refused)"
    assert shown["error"]["code"] == "port_lost"
    assert shown["broker"] == {"connected": False, "waiting": 42, "place": PLACE}
    device = line.device
    assert (device["values"], device["id"], device["fault"]) == ({"wind_speed": 6.5}, 2, None)
    assert device["wind"] is None, "a gust of before stands beside no value of now"
    assert device["good_at"] == round((line.wall - 0.5) * 1000) + 1
    assert line.model.recent("mast")[-1][1] == 6.5
    assert "mast" in line.model.changed


def test_while_the_broker_is_away_gust_mean_and_direction_are_those_of_the_status_file() -> None:
    line = PublishedLine()
    line.measure(1)
    line.publish("device/mast/wind", {"v": 1, "gust_10m": 9.0, "lull_10m": 1.0})
    line.model.link.connected = False
    line.wall += 1
    written = status(line.wall)
    written["devices"][0]["wind"] = {"unit": "m/s", "gust_10m": 7.5, "mean_10m": 5.5, "direction_2m": 210}
    line.model.on_status("/run/status.json", written, now=1.0)
    assert line.device["wind"] == {"unit": "m/s", "gust_10m": 7.5, "mean_10m": 5.5, "direction_2m": 210}


def test_a_status_file_that_is_written_no_more_is_not_live_and_the_newer_of_both_is_shown() -> None:
    line = PublishedLine()
    line.measure(1, 3.0)
    line.model.link.connected = False
    line.model.on_status("/run/status.json", status(line.wall + 100, value=6.5), now=0.0)
    assert line.model.summary(line.wall + 110)["source"]["kind"] == "none"
    assert next(iter(line.model.devices(None, line.wall + 110)))[1]["values"] == {"wind_speed": 6.5}
    line.publish("device/mast/state", sample(2, line.wall + 200, 4.0), after=200)
    assert line.device["values"] == {"wind_speed": 4.0}


def test_a_status_file_alone_shows_a_line_whose_broker_was_never_there() -> None:
    model = LineModel("line0", "line0", "lfs10d", Link(PLACE))
    model.on_status("/run/status.json", {"ts": "x"}, now=0.0)
    assert not model.summary(WALL)["known"]
    model.on_status("/run/status.json", {"ts": round(WALL * 1000), "line": [], "devices": 7}, now=0.0)
    assert model.summary(WALL)["known"]
    model.on_status("/run/status.json", status(WALL + 1), now=0.0)
    shown = model.summary(WALL + 1)
    assert (shown["source"]["kind"], shown["order"], shown["info"]["version"]) == ("status", ["mast"], "1.0")


def test_what_changed_is_named() -> None:
    line = PublishedLine(entry(), entry("roof"))
    line.model.summary(line.wall)
    line.model.changed.clear()
    line.measure(1)
    assert line.model.changed == {"mast"}
    assert [name for name, _ in line.model.devices(line.model.changed, line.wall)] == ["mast"]
    assert line.model.recent("roof") == []


def test_nothing_that_is_published_makes_the_whole_unreadable() -> None:
    line = PublishedLine(entry(label="x" * 10_000), entry("roof", label=math.nan, interval=math.inf, id=10**400))
    hostile = {"a": math.nan, "since": math.inf, "active": True, "code": ["x"], "percent": math.nan, "ts": math.nan}
    for topic in ("info", "line/state", "line/stats", "line/error", "event", "trace", "device/mast/error",
                  "device/mast/stats", "device/mast/wind", "device/mast/config"):  # fmt: skip
        line.publish(topic, hostile)
    line.publish("event", {"type": "scan_progress", **hostile})
    line.publish("device/mast/telemetry", sample(1, line.wall, math.nan, quality=math.nan, errors={"a": math.inf}))
    line.publish("device/mast/telemetry", sample(2, line.wall, 5.0, units={"wind_speed": "x" * 9999}, rtt_ms=math.inf))
    json.dumps(line.model.summary(line.wall), allow_nan=False)
    json.dumps(dict(line.model.devices(None, line.wall)), allow_nan=False)


HOSTILE_VALUES = [
    math.inf, math.nan, 10**400, "x" * 10_000, [], {}, {"a": math.inf}, [math.nan], True, None, -1, "<script>",
]  # fmt: skip
HOSTILE_KEYS = (
    "v", "seq", "ts", "boot", "wind_speed", "unit", "quality", "active", "type", "rtt_ms", "error", "errors", "units",
    "interval", "id", "label", "name", "enabled", "percent", "code", "since", "activity", "baudrate", "open", "port",
    "polls", "load_pct", "store", "clock", "profile", "mean_2m", "depth", "connected", "values", "alarm", "slave",
    "online", "message", "heard",
)  # fmt: skip
TOPICS = (
    "availability", "info", "devices", "line/state", "line/error", "line/stats", "event", "trace",
    "device/mast/state", "device/mast/telemetry", "device/mast/history", "device/mast/availability",
    "device/mast/stats", "device/mast/error", "device/mast/config", "device/mast/wind",
)  # fmt: skip


@pytest.mark.parametrize("value", HOSTILE_VALUES, ids=lambda value: repr(value)[:20])
def test_nothing_that_anybody_may_publish_or_write_stops_the_page_or_is_no_json(value: object) -> None:
    usual = {"v": 1, "seq": 5, "ts": round(WALL * 1000) + 1, "boot": "b", "wind_speed": 1.0, "quality": "good"}
    for key in HOSTILE_KEYS:
        for topic in TOPICS:
            line = PublishedLine()
            line.measure(1)
            payload = usual | {key: value}
            line.publish(topic, [payload] if topic in {"devices", "device/mast/history"} else payload)
            shown = [line.model.summary(line.wall), dict(line.model.devices(None, line.wall)), list(line.model.frames)]
            json.dumps(shown, allow_nan=False)
            metrics.text([line.model], line.wall, openmetrics=True)
        line = PublishedLine()
        line.model.link.connected = False
        for content in (usual | {key: value}, value):
            named = content | {"name": "mast"} if isinstance(content, dict) else content
            whole = usual | {"ts": round(line.wall * 1000), "info": content, "line": named, "broker": content}
            line.model.on_status("/run/x", whole | {"devices": [named]}, now=0.0)
            line.model.on_status("/run/x", usual | {"ts": value, "devices": content}, now=0.0)
            json.dumps([line.model.summary(line.wall), dict(line.model.devices(None, line.wall))], allow_nan=False)
            line.wall += 1.0
