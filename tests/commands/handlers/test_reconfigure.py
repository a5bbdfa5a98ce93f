"""`device/readdress` and `line/baudrate`: what is taken of them; what they do is told in tests/physical."""

from __future__ import annotations

import pytest

from lfs10d.commands.handlers.registry import HANDLERS
from lfs10d.reconfiguration.adopt_request import AdoptRequest
from tests.support.context import Ask, FakeContext


def test_a_readdress_is_handed_on_with_its_call(ask: Ask, fake: FakeContext) -> None:
    assert ask("device/readdress", '{"id":"q","device":"mast-top","to":9}').status == "ok"
    assert fake.done == [("readdress", "mast-top", 9, False, "q")]


def test_a_change_of_rate_is_handed_on_with_its_call(ask: Ask, fake: FakeContext) -> None:
    assert ask("line/baudrate", '{"id":7,"to":19200,"power_cycle":true,"dry_run":true}').status == "ok"
    assert fake.done == [("baudrate", 19200, True, True, 7)]


def test_the_rate_is_not_changed_while_the_port_is_freed(ask: Ask, fake: FakeContext) -> None:
    fake.paused = True
    answer = ask("line/baudrate", '{"to":19200}')
    assert (answer.status, answer.code, fake.done) == ("rejected", "line_error", [])


def test_a_newcomer_is_handed_on_with_its_call(ask: Ask, fake: FakeContext) -> None:
    assert ask("line/adopt", '{"id":7,"name":"north","label":"Mast, 10 m","from":5,"to":9}').status == "ok"
    assert ask("line/adopt").status == "ok"
    assert fake.done == [
        ("adopt", AdoptRequest("north", "Mast, 10 m", 5, 9, "lfs10"), 7),
        ("adopt", AdoptRequest(None, None, None, None, "lfs10"), None),
    ]


@pytest.mark.parametrize(
    ("name", "payload", "param"),
    [
        ("device/readdress", '{"device":"mast-top","to":true}', "to"),
        ("device/readdress", '{"device":"mast-top","to":0}', "to"),
        ("device/readdress", '{"device":"mast-top","to":256}', "to"),
        ("device/readdress", '{"device":"mast-top","to":9.0}', "to"),
        ("device/readdress", '{"device":"mast-top"}', "to"),
        ("device/readdress", '{"to":9}', "device"),
        ("line/adopt", '{"name":"North"}', "name"),
        ("line/adopt", '{"from":"1"}', "from"),
        ("line/adopt", '{"to":0}', "to"),
        ("line/baudrate", '{"to":"19200"}', "to"),
        ("line/baudrate", '{"to":14400}', "to"),
        ("line/baudrate", '{"to":9600,"power_cycle":1}', "power_cycle"),
    ],
)
def test_what_is_not_meant_exactly_is_not_done(
    ask: Ask, fake: FakeContext, name: str, payload: str, param: str
) -> None:
    answer = ask(name, payload)
    assert (answer.code, answer.facts["param"], fake.done) == ("invalid_param", param, [])


@pytest.mark.parametrize("name", ["device/readdress", "line/baudrate", "line/adopt"])
def test_the_answer_to_a_physical_change_is_kept_for_a_day(name: str) -> None:
    assert HANDLERS[name].spec.remembered_for == 24 * 3600
