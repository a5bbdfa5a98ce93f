"""A response in words."""

from __future__ import annotations

from datetime import UTC
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.cli.render.response import DEEPEST, content_lines, status_line

SAMPLE = {
    "v": 1,
    "line": "line0",
    "device": "mast-top",
    "boot": "k3f9a2c7",
    "seq": 5,
    "ts": 1_795_298_022_003,
    "time": "2026-11-21T21:53:42.003Z",
    "clock": "synced",
    "wind_speed": 12.34,
    "unit": "m/s",
    "quality": "good",
    "error": None,
    "rtt_ms": 18.2,
}


ANSWERED = "answered in 18.2 ms, at 2026-11-21 21:53:42.003 UTC"


@pytest.mark.parametrize(
    ("response", "words"),
    [
        ({"request": "health", "status": "ok", "error": None, "took_ms": 4.4}, "health: ok, 4 ms"),
        ({"request": "health", "status": "ok"}, "health: ok"),
        (
            {"request": "x", "status": "rejected", "error": {"code": "invalid_param", "message": "to: is missing"}},
            "x: rejected: invalid_param: to: is missing",
        ),
        (
            {"request": "\x1b[2J", "status": "failed", "error": {"code": 5, "message": "a\nb"}},
            r"\x1b[2J: failed: 5: a\nb",
        ),
        ({}, "null: null"),
    ],
)
def test_how_it_ended_is_one_line(response: dict[str, Any], words: str) -> None:
    assert status_line(response) == words


@pytest.mark.parametrize(
    ("sample", "words"),
    [
        (
            {**SAMPLE, "ts": None},
            "mast-top: wind_speed 12.34 m/s, good, answered in 18.2 ms, at 2026-11-21T21:53:42.003Z",
        ),
        (SAMPLE, "mast-top: wind_speed 12.34 m/s, good, answered in 18.2 ms, at 2026-11-21 21:53:42.003 UTC"),
        (
            {**SAMPLE, "wind_speed": None, "quality": "bad", "error": "timeout", "rtt_ms": None},
            "mast-top: wind_speed no value, bad (timeout), at 2026-11-21 21:53:42.003 UTC",
        ),
        (
            {key: value for key, value in SAMPLE.items() if key not in {"unit", "wind_speed"}}
            | {"units": {"speed": "rpm", "output_current": "A"}, "speed": 1450, "output_current": 1.5},
            "mast-top: speed 1450 rpm, output_current 1.5 A, good, answered in 18.2 ms, at 2026-11-21 21:53:42.003 UTC",
        ),
        (
            {key: value for key, value in SAMPLE.items() if key not in {"unit", "wind_speed"}}
            | {"units": {"speed": "m/s"}, "speed": 1.5, "sky": "rain", "heating": True, "humidity": None}
            | {"quality": "partial", "errors": {"humidity": "unavailable"}, "ages": {"sky": 34.2}},
            f"mast-top: speed 1.5 m/s, sky rain, heating true, humidity no value (unavailable), partial, {ANSWERED}",
        ),
    ],
)
def test_a_sample_is_one_line_with_every_value_and_its_unit(sample: dict[str, Any], words: str) -> None:
    assert list(content_lines({"data": sample}, UTC)) == [words]


def test_what_belongs_together_is_indented() -> None:
    data = {
        "applied": ["poll.interval"],
        "none": [],
        "found": [{"id": 3, "known": True}, 7],
        "broker": {"connected": False, "since": None},
        "empty": {},
    }
    assert list(content_lines({"data": data})) == [
        "applied: [poll.interval]",
        "none: []",
        "found:",
        "  -",
        "    id: 3",
        "    known: true",
        "  - 7",
        "broker:",
        "  connected: false",
        "  since: null",
        "empty: {}",
    ]


def test_without_data_nothing_is_told() -> None:
    assert list(content_lines({"data": None})) == []


def test_a_plain_value_is_told_as_it_is() -> None:
    assert list(content_lines({"data": "a\x07b"})) == [r"a\x07b"]


def test_what_lies_very_deep_is_shown_as_json() -> None:
    data: Any = {"bottom": 1}
    for _ in range(2 * DEEPEST):
        data = {"a": data}
    lines = list(content_lines({"data": data}))
    assert len(lines) == DEEPEST + 1
    assert lines[-1].endswith('"bottom": 1' + "}" * (DEEPEST + 1))


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=10,
)


@given(st.dictionaries(st.sampled_from(["request", "status", "data", "error", "took_ms"]), ANYTHING))
def test_whatever_a_response_holds_every_line_can_be_shown(response: dict[str, Any]) -> None:
    assert all(line.isprintable() for line in (status_line(response), *content_lines(response)))
