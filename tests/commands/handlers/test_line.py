"""`line/trace`, `line/pause` and `line/cancel`."""

from __future__ import annotations

import pytest

from tests.support.context import Ask, FakeContext


@pytest.mark.parametrize(
    ("payload", "seconds"), [("{}", 30.0), ('{"for":"10m"}', 600.0), ('{"for":5}', 5.0), ('{"for":"250ms"}', 0.25)]
)
@pytest.mark.parametrize("name", ["line/trace", "line/pause"])
def test_a_trace_or_a_pause_begins_for_the_time_asked_or_half_a_minute(
    ask: Ask, fake: FakeContext, name: str, payload: str, seconds: float
) -> None:
    answer = ask(name, payload)
    assert (answer.status, answer.data, fake.done) == ("ok", {"for": seconds}, [seconds])


@pytest.mark.parametrize("payload", ['{"for":"10m1s"}', '{"for":601}', '{"for":0}', '{"for":-1}', '{"for":"5"}'])
@pytest.mark.parametrize("name", ["line/trace", "line/pause"])
def test_one_longer_than_ten_minutes_or_of_no_duration_is_refused(
    ask: Ask, fake: FakeContext, name: str, payload: str
) -> None:
    answer = ask(name, payload)
    assert (answer.code, answer.facts["param"], fake.done) == ("invalid_param", "for", [])


def test_a_pause_waits_for_what_must_not_be_cut_off(ask: Ask, fake: FakeContext) -> None:
    fake.busy = True
    answer = ask("line/pause")
    assert (answer.status, answer.code, fake.done) == ("rejected", "busy", [])


def test_what_is_cancelled_is_told(ask: Ask, fake: FakeContext) -> None:
    fake.running = ("trace",)
    assert ask("line/cancel").data == {"cancelled": ["trace"]}
    assert ask("line/cancel").data == {"cancelled": []}
