"""The models refuse what the daemon promises never to send."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from docs.generate.payloads import Event, LineStats, Response, SamplePayload
from tests.support.samples import SAMPLE

GOOD: dict[str, Any] = SAMPLE.payload("line0")


def bad(**changes: object) -> dict[str, object]:
    return GOOD | {"wind_speed": None, "quality": "bad", "error": "timeout", "rtt_ms": None} | changes


def partial(**changes: object) -> dict[str, object]:
    several: dict[str, object] = {key: GOOD[key] for key in GOOD if key != "unit"}
    several |= {"rain": None, "units": {"wind_speed": "m/s", "rain": "mm"}, "quality": "partial"}
    return several | {"errors": {"rain": "unavailable"}} | changes


@pytest.mark.parametrize(
    "payload",
    [
        GOOD,
        partial(),
        partial(ages={"wind_speed": 60.0}),
        GOOD | {"wind_speed": "calm"},
        GOOD | {"wind_speed": False},
        GOOD | {"historical": True},
        bad(),
        bad(error=None, seq=0),
        {key: GOOD[key] for key in GOOD if key != "unit"} | {"gust": 13.1, "units": {"gust": "m/s"}},
    ],
    ids=[
        "good",
        "partial",
        "partial and old",
        "text",
        "yes or no",
        "historical",
        "failed",
        "first of a boot",
        "two values",
    ],
)
def test_a_sample_of_the_contract_is_accepted(payload: dict[str, object]) -> None:
    assert SamplePayload.model_validate_json(json.dumps(payload)).values


@pytest.mark.parametrize(
    "payload",
    [
        GOOD | {"wind_speed": None},
        GOOD | {"error": "crc"},
        GOOD | {"seq": 0},
        GOOD | {"gust": 13.1},
        GOOD | {"units": {"wind_speed": "m/s"}},
        GOOD | {"wind_speed": ["12.34"]},  # text by itself is a value: a profile may map contents to words
        GOOD | {"errors": {}},
        GOOD | {"errors": {"wind_speed": "unavailable"}},
        GOOD | {"ages": {"gust": 3.0}},
        GOOD | {"ages": {"wind_speed": -3.0}},
        GOOD | {"quality": "partial"},
        partial(rain=1),
        partial(errors=None),
        partial(errors={}),
        partial(errors={"rain": "timeout"}),
        partial(errors={"wind_speed": "unavailable"}),
        partial(errors={"rain": "unavailable", "wind_speed": "unavailable"}),
        partial(error="unavailable"),
        partial(seq=0),
        partial(wind_speed=None, errors={"rain": "unavailable", "wind_speed": "unavailable"}),
        partial(ages={"rain": 60.0}),
        bad(errors={"wind_speed": "unavailable"}),
        GOOD | {"time": "2026-11-21T21:53:42Z"},
        GOOD | {"clock": "perhaps"},
        GOOD | {"boot": "short"},
        bad(wind_speed=12.34),
        bad(rtt_ms=5.0),
        bad(error="cold feet"),
        {key: GOOD[key] for key in GOOD if key != "wind_speed"},
        {key: GOOD[key] for key in GOOD if key != "unit"},
    ],
)
def test_a_sample_that_contradicts_itself_is_refused(payload: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        SamplePayload.model_validate_json(json.dumps(payload))


@given(st.sampled_from(["NaN", "Infinity", "-Infinity"]), st.sampled_from(["wind_speed", "rtt_ms"]))
def test_what_is_no_number_is_refused_wherever_it_stands(number: str, key: str) -> None:
    text = json.dumps(GOOD | {key: float(number)})
    assert number in text
    with pytest.raises(ValidationError):
        SamplePayload.model_validate_json(text)


def test_an_event_may_have_any_facts_but_dropped_has_its_own() -> None:
    assert Event.model_validate({"v": 1, "type": "device_added", "ts": 1, "slave": 3}).type == "device_added"
    with pytest.raises(ValidationError, match="facts of its own"):
        Event.model_validate({"v": 1, "type": "dropped", "ts": 1})


def test_a_key_nobody_promised_is_refused() -> None:
    with pytest.raises(ValidationError, match="Extra inputs"):
        Response.model_validate(
            {"v": 1, "id": None, "request": "health", "status": "ok", "data": 1, "error": None}
            | {"took_ms": 1.0, "surprise": 1}
        )


def test_the_uart_s_breaks_are_spelled_as_in_the_contract() -> None:
    assert "break" in LineStats.model_json_schema()["$defs"]["Uart"]["properties"]
