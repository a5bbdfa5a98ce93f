"""The table of what goes out."""

from __future__ import annotations

import json

import pytest
from pydantic import ValidationError

from docs.generate.contract import OUTBOUND, check, outbound
from docs.generate.payloads import DroppedPayload, Event, NoError
from lfs10d.telemetry import publication

FINE = '{"v":1,"active":false,"code":null,"last_code":null,"cleared":null}'


def test_every_topic_of_the_contract_has_one_row() -> None:
    assert [(row.topic, row.retain, row.qos) for row in OUTBOUND] == [
        ("info", True, 1),
        ("devices", True, 1),
        ("line/state", True, 1),
        ("line/error", True, 1),
        ("line/stats", True, 0),
        ("device/+/state", True, 1),
        ("device/+/telemetry", False, 1),
        ("device/+/history", False, 1),
        ("device/+/config", True, 1),
        ("device/+/availability", True, 1),
        ("device/+/error", True, 1),
        ("device/+/stats", True, 0),
        ("device/+/wind", True, 1),
        ("device/+/record", False, 1),
        ("event", False, 1),
        ("response/+/+", False, 1),
        ("response/+", False, 1),
        ("trace", False, 0),
    ]


@pytest.mark.parametrize("topic", ["device/mast-top/error", "device/error/error", "line/error"])
def test_errors_of_line_and_devices_have_one_form(topic: str) -> None:
    assert isinstance(check(topic, FINE), NoError)


@pytest.mark.parametrize("topic", ["device/mast-top", "device/a/b/error", "weather", "device/a/winds"])
def test_a_topic_nobody_promised_is_unknown(topic: str) -> None:
    with pytest.raises(KeyError):
        outbound(topic)


def test_availability_is_a_bare_word() -> None:
    assert check("device/a/availability", "online") == "online"
    with pytest.raises(ValidationError):
        check("device/a/availability", '"online"')


def test_an_error_object_of_half_a_mind_is_refused() -> None:
    with pytest.raises(ValidationError):
        check("line/error", FINE.replace("false", "true"))


def test_dropped_is_told_from_other_events() -> None:
    lost = publication.dropped("a", "k3f9a2c7", 3, 9, count=7, ts=5)
    added = publication.event("device_added", 5, device="a")
    assert isinstance(check("event", json.dumps(lost.payload)), DroppedPayload)
    assert isinstance(check("event", json.dumps(added.payload)), Event)


def test_a_history_holds_a_hundred_samples_at_most() -> None:
    sample = publication.Sample(
        device="a",
        boot="k3f9a2c7",
        seq=1,
        ts=5,
        clock="synced",
        values=None,
        units={},
        names=("wind_speed",),
        quality="bad",
        error="timeout",
        rtt_ms=None,
    ).payload("line0", historical=True)
    assert check("device/a/history", json.dumps([sample] * 100))
    with pytest.raises(ValidationError, match="at most 100"):
        check("device/a/history", json.dumps([sample] * 101))
