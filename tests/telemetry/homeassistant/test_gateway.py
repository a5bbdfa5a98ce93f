"""The names of lines, devices and entities in Home Assistant."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.telemetry.homeassistant.gateway import (
    Gateway,
    config_topic,
    entity_id,
    is_about,
    object_id,
)

LEVELS = st.text(st.sampled_from("ab_-/.Ä "), min_size=1, max_size=6)
NAMES = st.text(st.sampled_from("ab_-"), min_size=1, max_size=5)


@pytest.mark.parametrize(
    ("base", "device", "found"),
    [
        ("lfs10d/line0", None, "lfs10d_lfs10d_line0"),
        ("lfs10d/line0", "mast-top", "lfs10d_lfs10d_line0_mast-top"),
        ("site/gw1/line0", None, "lfs10d_site_gw1_line0-e9bcc3"),
        ("Site/line_0", "a_b", "lfs10d_site_line_0-8be1b9_a_b"),
    ],
)
def test_a_line_and_its_devices_are_named_by_base_topic_line_and_name(
    base: str, device: str | None, found: str
) -> None:
    assert object_id(base, device) == found


@given(LEVELS, NAMES, st.none() | NAMES, LEVELS, NAMES, st.none() | NAMES)
def test_no_two_of_any_gateways_have_one_object_id(
    base: str, line: str, device: str | None, other_base: str, other_line: str, other: str | None
) -> None:
    one, two = (f"{base}/{line}", device), (f"{other_base}/{other_line}", other)
    assert re.fullmatch(r"[a-z0-9_-]+", object_id(*one))
    assert (object_id(*one) == object_id(*two)) is (one == two)


def test_an_entity_id_has_the_words_of_line_device_and_entity() -> None:
    assert entity_id("sensor", "lfs10d/line0", "mast-top", "Wind gust") == "sensor.lfs10d_line0_mast_top_wind_gust"
    assert entity_id("button", "ä/line0", "_scan_") == "button.line0_scan"


def test_a_payload_is_known_by_the_daemons_availability() -> None:
    ours = {"availability": [{"topic": "lfs10d/a/availability"}, {"topic": "lfs10d/a/device/b/availability"}]}
    assert is_about(ours, "lfs10d/a/availability")
    assert not is_about(ours, "lfs10d/a_b/availability")
    assert not is_about({"availability": "lfs10d/a/availability"}, "lfs10d/a/availability")
    assert not is_about({}, "lfs10d/a/availability")


def test_the_topics_of_a_gateway() -> None:
    gateway = Gateway("lfs10d/line0", "homeassistant", "1.0", frozenset(), 1.0, 10.0)
    assert gateway.topic("line/stats") == "lfs10d/line0/line/stats"
    assert config_topic(gateway.prefix, "x") == "homeassistant/device/x/config"
