"""What the log says of each request."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.command import Command, Result, failed, ok, rejected
from lfs10d.telemetry import command_log

ANY = st.recursive(st.none() | st.integers() | st.text(), lambda inner: st.dictionaries(st.text(), inner), max_leaves=5)


@pytest.mark.parametrize(
    ("name", "parameters", "answer", "words"),
    [
        (
            "device/add",
            {"slave": 5, "name": "crane"},
            ok({"device": "crane", "slave": 5, "interval": 1.0}),
            'ok: device crane, from null, to {"slave":5,"interval":1.0}',
        ),
        (
            "device/remove",
            {"device": "crane"},
            ok({"device": "crane", "slave": 5}),
            'ok: device crane, from {"slave":5}, to null',
        ),
        (
            "device/options",
            {"device": "mast-top", "interval": "500ms"},
            ok({"from": {"interval": 1.0}, "to": {"interval": 0.5}}),
            'ok: device mast-top, from {"interval":1.0}, to {"interval":0.5}',
        ),
        (
            "device/readdress",
            {"device": "slave-3", "to": 9},
            ok({"device": "slave-3", "from": 3, "to": 9}),
            "ok: device slave-3, from 3, to 9",
        ),
        (
            "device/readdress",
            {"device": "slave-3", "to": 9, "dry_run": True},
            ok({"device": "slave-3", "from": 3, "to": 9, "dry_run": True}),
            "ok: device slave-3, from 3, to 9, dry_run true",
        ),
        (
            "device/readdress",
            {"device": "slave-3", "to": 9},
            failed("not_verified", "it is looked for", data={"device": "slave-3", "from": 3, "to": 9}),
            "failed (not_verified): device slave-3, to 9: it is looked for",
        ),
        (
            "line/adopt",
            {"name": "north"},
            ok({"device": "north", "slave": 6, "from": 1}),
            "ok: device north, from 1, to 6",
        ),
        (
            "line/baudrate",
            {"to": 19200},
            ok({"from": 9600, "to": 19200, "pending": ["mast-top"]}),
            'ok: from 9600, to 19200, pending ["mast-top"]',
        ),
        (
            "register/write",
            {"slave": 7, "address": 8192, "value": 1},
            ok({"device": None, "slave": 7, "address": 8192, "value": 1, "before": 0}),
            "ok: slave 7, address 8192, from 0, to 1",
        ),
        (
            "config/reset",
            {"device": "mast-top"},
            ok({"dropped": ["slaves.mast-top.interval"], "changed": []}),
            'ok: device mast-top, dropped ["slaves.mast-top.interval"]',
        ),
        (
            "config/reload",
            {},
            ok({"applied": ["poll.interval"], "restart_required": []}),
            'ok: applied ["poll.interval"]',
        ),
        ("line/cancel", {}, ok({"cancelled": []}), "ok"),
        (
            "device/options",
            {"device": "mast"},
            rejected("unknown_device", "there is no device mast"),
            "rejected (unknown_device): device mast: there is no device mast",
        ),
    ],
)
def test_one_line_says_what_of_which_device_from_and_to(
    name: str, parameters: dict[str, Any], answer: Result, words: str
) -> None:
    assert command_log.line(name, Command("a1", None, parameters), answer) == f"request {name} (id a1): {words}"


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (Command(), "request x: ok"),
        (Command(7), "request x (id 7): ok"),
        (Command(None, "t"), "request x (id t): ok"),
        (Command(7, "t"), "request x (id 7): ok"),
    ],
)
def test_it_names_the_request_by_its_id(call: Command, words: str) -> None:
    assert command_log.line("x", call, ok()) == words


@given(st.text(), ANY, st.dictionaries(st.text(), ANY), st.sampled_from(["device/add", "line/adopt", "x"]))
def test_whatever_it_holds_it_is_one_line_and_no_long_one(
    text: str, data: object, parameters: dict[str, Any], name: str
) -> None:
    for answer in (ok(data), ok({"device": text, "from": data}), failed("internal", text, data=data)):
        assert command_log.line(name, Command(text, None, parameters), answer).isprintable()
    assert len(command_log.line("x", Command("i", None, {"device": "x" * 4000}), ok())) < command_log.LONGEST + 100
