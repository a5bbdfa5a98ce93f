"""Samples, publications and events as they go out."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.reading import FaultCode
from lfs10d.telemetry.publication import (
    Publication,
    PublicationKind,
    device_of,
    device_topic,
    dropped,
    event,
    iso_time,
    retained,
)
from tests.support.samples import SAMPLE


def test_a_sample_is_the_contract_s_line_to_the_letter() -> None:
    line = json.dumps(SAMPLE.payload("line0"), separators=(",", ":"))
    assert line == (
        '{"v":1,"line":"line0","device":"mast-top","boot":"k3f9a2c7","seq":48211,"ts":1795298022003,'
        '"time":"2026-11-21T21:53:42.003Z","clock":"synced","wind_speed":12.34,"unit":"m/s",'
        '"quality":"good","error":null,"rtt_ms":18.2}'
    )


def test_a_bad_sample_carries_a_null_under_every_value_name() -> None:
    bad = replace(
        SAMPLE,
        values=None,
        names=("current", "voltage"),
        units={"current": "A", "voltage": "V"},
        quality="bad",
        error="timeout",
        rtt_ms=None,
    )
    payload = bad.payload("line0")
    assert (payload["current"], payload["voltage"]) == (None, None)
    assert (payload["quality"], payload["error"], payload["rtt_ms"]) == ("bad", "timeout", None)


def test_several_values_have_units_by_name_and_no_unit() -> None:
    several = replace(
        SAMPLE,
        values={"current": 1.5, "voltage": 230},
        names=("current", "voltage"),
        units={"current": "A", "voltage": "V"},
    )
    payload = several.payload("line0")
    assert payload["units"] == {"current": "A", "voltage": "V"}
    assert "unit" not in payload
    assert (payload["current"], payload["voltage"]) == (1.5, 230)


def test_a_partial_sample_says_why_and_how_old_and_keeps_the_profile_s_order() -> None:
    partial = replace(
        SAMPLE,
        values={"weather": "rain", "current": 1.5},
        names=("current", "voltage", "weather"),
        quality="partial",
        errors={"voltage": FaultCode.UNAVAILABLE},
        ages={"weather": 34.2},
    )
    text = json.dumps(partial.payload("line0", historical=True), separators=(",", ":"))
    assert '"current":1.5,"voltage":null,"weather":"rain","units":' in text
    assert text.endswith(
        '"quality":"partial","error":null,"rtt_ms":18.2,"errors":{"voltage":"unavailable"},"ages":{"weather":34.2},'
        '"historical":true}'
    )


def test_one_value_without_a_unit_has_unit_null() -> None:
    assert replace(SAMPLE, units={}).payload("line0")["unit"] is None


def test_history_alone_is_marked_historical() -> None:
    assert SAMPLE.payload("line0", historical=True) == {**SAMPLE.payload("line0"), "historical": True}
    assert "historical" not in SAMPLE.payload("line0")


@given(st.integers(0, 4_102_444_800_000))
def test_time_is_ts_in_another_spelling(ts: int) -> None:
    text = iso_time(ts)
    assert round(datetime.fromisoformat(text).timestamp() * 1000) == ts
    assert len(text) == len("2026-11-21T21:53:42.003Z")


def test_a_time_before_the_epoch_is_still_a_time() -> None:
    assert iso_time(-1) == "1969-12-31T23:59:59.999Z"


def test_a_retained_publication_is_kept_by_the_broker_at_least_once() -> None:
    topic = device_topic("mast-top", "state")
    assert topic == "device/mast-top/state"
    assert retained(topic, None) == Publication(topic, None, PublicationKind.RETAINED, retain=True, qos=1)
    assert retained("line/stats", {}, qos=0).qos == 0


def test_an_event_tells_its_type_time_and_facts() -> None:
    assert event("device_added", 7, device="a", slave=3) == Publication(
        "event",
        {"v": 1, "type": "device_added", "ts": 7, "device": "a", "slave": 3},
        PublicationKind.EVENT,
        retain=False,
        qos=1,
    )


def test_dropped_declares_which_numbers_are_gone() -> None:
    lost = dropped("a", "k3f9a2c7", 3, 9, count=7, ts=5)
    assert lost.payload == {
        "v": 1,
        "type": "dropped",
        "ts": 5,
        "device": "a",
        "boot": "k3f9a2c7",
        "from_seq": 3,
        "to_seq": 9,
        "count": 7,
    }


@pytest.mark.parametrize(
    ("topic", "device"),
    [
        ("device/mast-top/state", "mast-top"),
        ("device/mast-top/error", None),
        ("device/state", None),
        ("device/a/b/state", None),
        ("line/a/state", None),
    ],
)
def test_a_topic_tells_whose_it_is(topic: str, device: str | None) -> None:
    assert device_of(topic, "state") == device


def test_a_loss_of_records_says_so() -> None:
    lost = dropped("mast-top/record", "k3f9a2c7", 3, 5, count=3, ts=7).payload
    assert lost == {
        "v": 1, "type": "dropped", "ts": 7, "device": "mast-top", "boot": "k3f9a2c7", "from_seq": 3, "to_seq": 5,
        "count": 3, "topic": "record",
    }  # fmt: skip


def test_a_sample_is_counted_by_its_device_and_grouped_on_history() -> None:
    assert (SAMPLE.source, SAMPLE.history_topic, SAMPLE.grouped) == ("mast-top", "device/mast-top/history", True)
