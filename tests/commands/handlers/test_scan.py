"""`line/scan`: where to look, what is told of whom, and who is added."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lfs10d.config.changes import Place
from lfs10d.line.jobs.identification import FoundDevice
from lfs10d.profiles.library import load_profile
from tests.support.context import Ask, Asked, FakeContext

LFS10 = load_profile("lfs10", relative_to=Path())
LD_E = load_profile("ld-e", relative_to=Path())
ALL = tuple(range(1, 256))


@pytest.mark.parametrize(
    ("parameters", "wanted"),
    [
        ({}, (ALL, (), 0.3)),
        ({"ids": "1-255"}, (ALL, (), 0.3)),
        ({"ids": "7,3-5,4"}, ((3, 4, 5, 7), (), 0.3)),
        ({"ids": [9, 2, 9]}, ((2, 9), (), 0.3)),
        ({"baudrates": [19200, 9600, 19200]}, (ALL, (19200, 9600), 0.3)),
        ({"baudrates": None}, (ALL, (), 0.3)),
        ({"share": 100}, (ALL, (), 1.0)),
    ],
)
def test_it_is_looked_where_it_is_said(
    asked: Asked, fake: FakeContext, parameters: dict[str, Any], wanted: tuple[object, ...]
) -> None:
    assert asked("line/scan", **parameters) == ("ok", {"found": []})
    assert fake.done == [wanted]


@pytest.mark.parametrize(
    ("param", "value"),
    [
        *(("ids", value) for value in ("0-3", "1-256", "5-1", "", "a", [], [0], [256], ["1"], [True], 1, None)),
        *(("baudrates", value) for value in ([], [9601], ["9600"], 9600, "9600", [True])),
        *(("share", value) for value in (0, 101, "30", 0.3, True)),
        *(("add", value) for value in (1, "true", None)),
    ],
)
def test_what_is_no_place_to_look_at_is_refused(asked: Asked, fake: FakeContext, param: str, value: object) -> None:
    assert asked("line/scan", **{param: value}) == ("rejected", ("invalid_param", param))
    assert fake.done == []


def test_a_second_scan_waits(asked: Asked, fake: FakeContext) -> None:
    fake.busy = True
    assert asked("line/scan") == ("rejected", ("busy", None))


def found(slave: int, baudrate: int = 9600, **facts: Any) -> FoundDevice:  # noqa: ANN401 - as Finding has them
    return FoundDevice(slave, baudrate, answers=True, **{"profile": LFS10, "rtt": 0.0213, **facts})


def test_each_who_was_found_is_told_with_what_is_known_of_it(asked: Asked, fake: FakeContext) -> None:
    fake.findings = (
        found(2, alternatives=(LD_E,)),
        found(3, 19200),
        found(4, profile=None, duplicate=True),
        found(255),
    )
    status, data = asked("line/scan")
    assert status == "ok"
    first, strange, last, other = data["found"]
    assert first == {
        "id": 2, "baudrate": 9600, "known": True, "suspect": False, "duplicate": False,
        "device": "mast-top", "profile": "lfs10", "alternatives": ["ld-e"], "rtt_ms": 21.3,
    }  # fmt: skip
    assert (strange["profile"], strange["duplicate"], strange["known"]) == (None, True, False)
    assert (last["suspect"], last["known"]) == (True, False)
    assert (other["id"], other["known"]) == (3, False), "it speaks at another rate: not the one that is configured"


@pytest.mark.parametrize(("scanned", "code"), [((False, False), "cancelled"), ((False, True), "line_error")])
def test_a_scan_that_did_not_come_to_its_end_tells_what_it_found_and_adds_nobody(
    ask: Ask, fake: FakeContext, scanned: tuple[bool, bool], code: str
) -> None:
    fake.findings, fake.scanned, fake.at = (found(9),), scanned, {9}
    answer = ask("line/scan", '{"add":true,"ids":"1-20"}')
    assert (answer.status, answer.code) == ("failed", code)
    assert answer.message.endswith("after 0 of 40 ids")
    assert isinstance(answer.data, dict)
    assert [each["id"] for each in answer.data["found"]] == [9]
    assert len(fake.done) == 1


def test_who_is_new_recognised_and_beyond_doubt_is_added_as_by_device_add(asked: Asked, fake: FakeContext) -> None:
    fake.findings = (
        found(2),
        found(5),
        found(6, profile=LD_E),
        found(7, profile=None),
        found(8, duplicate=True),
        found(9, 19200),
        found(10, alternatives=(LD_E,)),
        found(250),
    )
    fake.at = {5, 6, 10}
    status, data = asked("line/scan", add=True, id="s")
    assert status == "ok"
    assert [(each["device"], each["slave"], each["profile"]) for each in data["added"]] == [
        ("slave-5", 5, "lfs10"),
        ("slave-6", 6, "ld-e"),
    ]
    assert data["not_added"] == []
    assert [each["id"] for each in fake.told] == ["s", "s"]
    assert fake.holding.now.changes.of("slave-6").added_at == Place(6)


def test_who_could_not_be_added_is_told_with_the_reason(asked: Asked, fake: FakeContext) -> None:
    fake.findings = (found(5), found(77))
    status, data = asked("line/scan", add=True)
    assert (status, data["added"]) == ("ok", [])
    assert [(each["id"], each["error"]["code"]) for each in data["not_added"]] == [
        (5, "line_error"),
        (77, "address_in_use"),
    ]
