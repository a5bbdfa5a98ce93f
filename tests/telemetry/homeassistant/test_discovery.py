"""Whole payloads, as they are published and as Home Assistant 2026.11 takes them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from lfs10d.reading import FaultCode
from lfs10d.telemetry.homeassistant.discovery import Announced, announcements, platforms, transition
from lfs10d.telemetry.homeassistant.gateway import DiscoveredDevice, DiscoveredValue, Gateway
from tests.support.homeassistant_keys import complaints

GOLDEN = Path(__file__).parent / "golden.json"
LINE = "homeassistant/device/lfs10d_lfs10d_line0/config"
MAST = "homeassistant/device/lfs10d_lfs10d_line0_mast-top/config"
STATION = "homeassistant/device/lfs10d_lfs10d_line0_station/config"
SPEED = DiscoveredValue("wind_speed", "m/s", 2, "wind_speed")
DEVICES = (
    DiscoveredDevice("mast-top", 'Mast, "10 m"', None, "LFS10", 0.25, (SPEED,), SPEED),
    DiscoveredDevice(
        "station",
        None,
        "Renke",
        "Weather station",
        60.0,
        (
            DiscoveredValue("temperature", "°C", 1, "temperature"),
            DiscoveredValue("direction", "°", 0, "wind_direction"),
            DiscoveredValue("weather", kind="text", options=("dry", "rain")),
            DiscoveredValue("heating", kind="boolean"),
        ),
    ),
)


def announced(*devices: DiscoveredDevice, commands: str = "polling sensors") -> dict[str, Announced]:
    gateway = Gateway("lfs10d/line0", "homeassistant", "1.2.3", frozenset(commands.split()), 1.0, 10.0)
    return announcements(gateway, devices or DEVICES)


def test_the_payloads_are_those_that_were_watched_in_home_assistant() -> None:
    """After a change on purpose: watch it there, then write what this compares into golden.json."""
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))
    for payload in golden.values():
        for component in payload["components"].values():
            if component.get("options") == ["none", "..."]:
                component["options"] = ["none", *FaultCode]
    assert announced() == golden


def test_the_line_comes_first_and_every_device_is_reached_by_it() -> None:
    found: dict[str, Any] = announced()
    assert list(found) == [LINE, MAST, STATION]
    assert {found[topic]["device"].get("via_device") for topic in (MAST, STATION)} == {"lfs10d_lfs10d_line0"}


def test_home_assistant_knows_every_key() -> None:
    for payload in announced().values():
        assert list(complaints(payload)) == []


def test_an_unknown_or_deprecated_key_would_be_noticed() -> None:
    payload: dict[str, Any] = announced()[MAST]
    payload["device"]["via_hub"] = "x"
    payload["components"]["wind_speed"]["object_id"] = "x"
    payload["components"]["read-now"]["value_template"] = "x"
    payload["availability_topic"] = "x"
    del payload["components"]["fault-code"]["unique_id"]
    payload["components"]["wind-gust"]["unit_of_measurement"] = "Hz"
    assert len(list(complaints(payload))) == 6


def test_a_device_without_a_label_goes_by_its_name() -> None:
    found: dict[str, Any] = announced()
    assert (found[MAST]["device"]["name"], found[STATION]["device"]["name"]) == ('Mast, "10 m"', "station")
    assert "manufacturer" not in found[MAST]["device"]


def test_what_is_new_or_another_is_published_once() -> None:
    steps = transition({}, announced())
    assert (steps.first, steps.then) == (announced(), {})


def test_devices_that_are_gone_are_cleared_the_line_last() -> None:
    known = {topic: platforms(payload) for topic, payload in announced().items()}
    assert list(transition(known, {}).first.items()) == [(MAST, None), (STATION, None), (LINE, None)]
    only = {LINE: announced()[LINE]}
    assert transition(known, only).first == {MAST: None, STATION: None, **only}


def test_an_entity_that_is_gone_is_first_named_by_its_platform_alone() -> None:
    known = {topic: platforms(payload) for topic, payload in announced().items()}
    wanted = announced(commands="sensors")
    steps = transition(known, wanted)
    first: Any = steps.first[MAST]
    assert {key: each for key, each in first["components"].items() if set(each) == {"platform"}} == {
        "poll-interval": {"platform": "number"},
        "polling-switch": {"platform": "switch"},
        "read-now": {"platform": "button"},
    }
    assert list(complaints(first)) == []
    assert steps.then == wanted


def test_an_entity_of_another_platform_is_removed_first() -> None:
    before = announced(DiscoveredDevice("station", None, None, "x", 1.0, (DiscoveredValue("state"),)))
    after = announced(DiscoveredDevice("station", None, None, "x", 1.0, (DiscoveredValue("state", kind="boolean"),)))
    steps = transition({STATION: platforms(before[STATION])}, {STATION: after[STATION]})
    first: Any = steps.first[STATION]
    assert first["components"]["state"] == {"platform": "sensor"}
    assert steps.then == {STATION: after[STATION]}


def test_a_payload_that_somebody_else_wrote_has_the_components_that_can_be_read() -> None:
    assert platforms({"components": {"a": {"platform": "sensor"}, "b": {"platform": 5}, "c": 7}}) == {"a": "sensor"}
    assert platforms({"components": []}) == {}
    assert transition({LINE: {}}, {LINE: {"components": []}}).first == {LINE: {"components": []}}
    assert transition({LINE: {"a": "sensor"}}, {LINE: {"components": 1}}).first == {
        LINE: {"components": {"a": {"platform": "sensor"}}}
    }


NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True)
TEXTS = st.text(max_size=8) | st.sampled_from(["wind_speed", "m/s", "°C", "temperature", "1"])
VALUES = st.builds(
    DiscoveredValue,
    name=NAMES,
    unit=st.none() | TEXTS,
    precision=st.none() | st.integers(0, 9),
    device_class=st.none() | TEXTS,
    kind=st.sampled_from(["number", "text", "boolean"]),
    options=st.lists(TEXTS, max_size=3, unique=True).map(tuple),
)


@given(st.lists(VALUES, min_size=1, max_size=5, unique_by=lambda value: value.name), st.none() | TEXTS)
def test_whatever_a_profile_says_home_assistant_takes_it(values: list[DiscoveredValue], label: str | None) -> None:
    for payload in announced(DiscoveredDevice("a", label, None, "b", 1.0, tuple(values), values[0])).values():
        assert list(complaints(json.loads(json.dumps(payload)))) == []
