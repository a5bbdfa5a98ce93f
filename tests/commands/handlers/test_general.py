"""`health` and `republish`."""

from __future__ import annotations

from tests.support.context import Ask, FakeContext


def test_health_is_told(ask: Ask) -> None:
    answer = ask("health")
    assert (answer.status, answer.data) == ("ok", {"v": 1})


def test_republish_sends_everything_once_more_and_tells_how_much(ask: Ask, fake: FakeContext) -> None:
    assert ask("republish").data == {"topics": 17}
    assert fake.done == ["republish"]
