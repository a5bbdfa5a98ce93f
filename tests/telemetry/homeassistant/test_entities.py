"""The entities of a device and of the line."""

from __future__ import annotations

import json
from typing import Any

import pytest

from lfs10d.telemetry.homeassistant.entities import device_components, line_components
from lfs10d.telemetry.homeassistant.gateway import DiscoveredDevice, DiscoveredValue, Gateway

SPEED = DiscoveredValue("wind_speed", "m/s", 2, "wind_speed")
EVERYTHING = frozenset({"polling", "sensors", "registers"})
CONTROLS = {"poll-interval", "polling-switch", "read-now"}


def gateway(commands: frozenset[str] = EVERYTHING, *, state_every: float = 1.0, wind_every: float = 10.0) -> Gateway:
    return Gateway("lfs10d/line0", "homeassistant", "1.0", commands, state_every, wind_every)


def device(*values: DiscoveredValue, interval: float = 1.0, label: str | None = None) -> DiscoveredDevice:
    return DiscoveredDevice("mast-top", label, None, "LFS10", interval, values or (SPEED,), None if values else SPEED)


def components(*values: DiscoveredValue, **changes: Any) -> dict[str, Any]:  # noqa: ANN401 - as `device`
    return device_components(gateway(), device(*values, **changes))


def test_a_value_is_shown_from_the_state_by_its_name() -> None:
    assert components()["wind_speed"] == {
        "platform": "sensor",
        "unique_id": "lfs10d_lfs10d_line0_mast-top.wind_speed",
        "default_entity_id": "sensor.lfs10d_line0_mast_top_wind_speed",
        "name": "Wind speed",
        "device_class": "wind_speed",
        "state_class": "measurement",
        "unit_of_measurement": "m/s",
        "suggested_display_precision": 2,
        "state_topic": "lfs10d/line0/device/mast-top/state",
        "value_template": "{{ value_json['wind_speed'] }}",
        "expire_after": 30,
    }


def test_texts_and_booleans_are_shown_as_such() -> None:
    found = components(
        DiscoveredValue("serial", kind="text"),
        DiscoveredValue("weather", kind="text", options=("dry", "rain")),
        DiscoveredValue("heating", kind="boolean"),
    )
    assert found["serial"].keys().isdisjoint({"state_class", "options", "unit_of_measurement", "device_class"})
    assert (found["weather"]["device_class"], found["weather"]["options"]) == ("enum", ["dry", "rain"])
    assert found["heating"]["platform"] == "binary_sensor"
    assert (found["heating"]["payload_on"], found["heating"]["payload_off"]) == ("True", "False")


@pytest.mark.parametrize(
    ("interval", "state_every", "wind_every", "of_state", "of_wind"),
    [(0.0, 1.0, 10.0, 30, 30), (20.0, 1.0, 10.0, 60, 30), (1.0, 3600.0, 60.0, 10_800, 180), (10.1, 1.0, 1.0, 31, 30)],
)
def test_a_value_expires_after_three_times_what_it_comes_by(
    interval: float, state_every: float, wind_every: float, of_state: int, of_wind: int
) -> None:
    found = device_components(gateway(state_every=state_every, wind_every=wind_every), device(interval=interval))
    assert found["wind_speed"]["expire_after"] == of_state
    assert found["wind-gust"]["expire_after"] == of_wind


def test_wind_statistics_are_shown_of_a_device_that_has_them() -> None:
    found = components()
    assert {key: found[key]["value_template"] for key in found if key.startswith("wind-")} == {
        "wind-gust": "{{ value_json['gust_10m'] }}",
        "wind-mean-2m": "{{ value_json['mean_2m'] }}",
        "wind-mean-10m": "{{ value_json['mean_10m'] }}",
    }
    assert found["wind-gust"]["state_topic"] == "lfs10d/line0/device/mast-top/wind"
    assert not [key for key in components(DiscoveredValue("heat", "°C")) if key.startswith("wind-")]


@pytest.mark.parametrize(
    ("commands", "of_device", "of_line"),
    [
        (frozenset(), set(), set()),
        (frozenset({"polling"}), CONTROLS, {"config-reload"}),
        (frozenset({"sensors"}), set(), {"line-scan"}),
        (frozenset({"registers"}), set(), set()),
        (EVERYTHING, CONTROLS, {"config-reload", "line-scan"}),
    ],
)
def test_there_are_controls_for_what_is_obeyed_alone(
    commands: frozenset[str], of_device: set[str], of_line: set[str]
) -> None:
    found = device_components(gateway(commands), device())
    assert {key for key, each in found.items() if "command_topic" in each} == of_device
    assert {key for key, each in line_components(gateway(commands)).items() if "command_topic" in each} == of_line


def test_each_control_sends_one_request() -> None:
    found: dict[str, Any] = {**components(), **line_components(gateway())}
    name = {"device": "mast-top"}
    assert json.loads(found["read-now"]["payload_press"]) == name
    assert json.loads(found["polling-switch"]["payload_on"]) == {**name, "enabled": True}
    assert json.loads(found["polling-switch"]["payload_off"]) == {**name, "enabled": False}
    interval = found["poll-interval"]["command_template"].replace("{{ value }}", "2.5")
    assert json.loads(interval) == {**name, "interval": 2.5}
    assert (found["line-scan"]["payload_press"], found["config-reload"]["payload_press"]) == ("{}", "{}")
    assert {key: each["command_topic"] for key, each in found.items() if "command_topic" in each} == {
        "poll-interval": "lfs10d/line0/request/device/options",
        "polling-switch": "lfs10d/line0/request/device/options",
        "read-now": "lfs10d/line0/request/device/read",
        "line-scan": "lfs10d/line0/request/line/scan",
        "config-reload": "lfs10d/line0/request/config/reload",
    }


def test_what_is_not_measured_is_available_while_the_daemon_is() -> None:
    daemon = [{"topic": "lfs10d/line0/availability"}]
    found = components()
    assert {key for key, each in found.items() if each.get("availability") == daemon} == CONTROLS | {
        "fault-state", "fault-code", "response-time", "poll-success", "last-seen",
    }  # fmt: skip
    assert {key for key, each in found.items() if "availability" not in each} == {
        "wind_speed", "wind-gust", "wind-mean-2m", "wind-mean-10m",
    }  # fmt: skip
    assert line_components(gateway())["mqtt-connection"]["availability"] == []  # off, not unavailable


def test_what_few_people_want_is_disabled_by_default() -> None:
    found = components()
    disabled = {key for key, each in found.items() if each.get("enabled_by_default") is False}
    assert disabled == {"response-time", "poll-success", "last-seen"}


def test_no_text_of_a_person_stands_in_a_template() -> None:
    found = components(label="{{ 7 * 7 }} {% raw %}")
    templates = [each[key] for each in found.values() for key in each if key.endswith("_template")]
    assert templates
    assert not [each for each in templates if "7 * 7" in each or "{%" in each]


def test_no_name_of_a_value_is_one_of_ours() -> None:
    """Names of values are of a-z 0-9 _: `EH600` has a value `fault`."""
    found = components(*(DiscoveredValue(name, "1") for name in ("fault", "polling", "read_now")))
    assert all("-" in key for key in found if key not in {"fault", "polling", "read_now"})
    assert all("-" in key for key in line_components(gateway()))
    ids = [each["unique_id"] for each in found.values()]
    assert len(set(ids)) == len(ids)
