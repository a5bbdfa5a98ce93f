"""Which topics are passed over, and when each is tried again."""

from __future__ import annotations

import pytest

from lfs10d.outbox.refusals import BANNED_FOR, LATER_FIRST, LATER_LONGEST, Refusal, Refusals, refusal_of

LATER, DENIED, UNKNOWN = 0x97, 0x87, 0xC7


@pytest.mark.parametrize("reason", range(0x80, 0x100))
def test_every_code_from_0x80_on_is_a_refusal_of_one_kind(reason: int) -> None:
    kinds = {0x90: "unfit", 0x95: "unfit", 0x99: "unfit", 0x80: "later", 0x83: "later", 0x91: "later", 0x97: "later"}
    assert refusal_of(reason) == kinds.get(reason, "denied")


def test_a_passing_refusal_is_over_after_1_2_4_to_60_s_and_reported_once() -> None:
    refusals, now, waits, told = Refusals(), 0.0, [], []
    for _ in range(8):
        told.append(refusals.refused("t", LATER, now))
        assert refusals.topics == {"t"}
        assert refusals.lift(now + 0.5 * LATER_FIRST) == frozenset()
        due = refusals.due()
        assert due is not None
        waits.append(due - now)
        now = due
        assert refusals.lift(now) == {"t"}
        assert refusals.topics == set()
    assert waits == [1, 2, 4, 8, 16, 32, LATER_LONGEST, LATER_LONGEST]
    assert told == [True, *[False] * 7]


def test_what_the_broker_takes_begins_anew() -> None:
    refusals = Refusals()
    refusals.accepted("t")
    for now in (0.0, 1.0):
        refusals.refused("t", LATER, now)
        refusals.lift(now + 10)
    refusals.accepted("other")
    refusals.accepted("t")
    assert refusals.refused("t", LATER, 20.0)
    assert refusals.due() == 20.0 + LATER_FIRST


@pytest.mark.parametrize("reason", [DENIED, UNKNOWN])
def test_a_denied_topic_is_tried_again_at_the_next_connect(reason: int) -> None:
    refusals = Refusals()
    assert refusals.refused("t", reason, 0.0)
    assert refusals.due() is None
    assert refusals.lift(1e9) == frozenset()
    assert refusals.connected(1e9) == {"t"}
    assert not refusals.refused("t", reason, 1e9), "it was reported"


def test_a_topic_that_ends_connections_rests_for_an_hour_over_connects() -> None:
    refusals = Refusals()
    refusals.ban("t", 5.0)
    refusals.refused("other", DENIED, 5.0)
    assert refusals.connected(6.0) == {"other"}
    assert refusals.topics == {"t"}
    assert refusals.due() == 5.0 + BANNED_FOR
    assert refusals.lift(5.0 + BANNED_FOR) == {"t"}
    assert refusals.due() is None


def test_a_reload_tries_everything_again_and_reports_anew() -> None:
    refusals = Refusals()
    refusals.ban("a", 0.0)
    refusals.refused("b", DENIED, 0.0)
    refusals.refused("c", LATER, 0.0)
    assert refusals.reload(0.1) == {"a", "b", "c"}
    assert refusals.reload(0.1) == frozenset()
    assert refusals.refused("b", DENIED, 1.0)


def test_one_that_is_refused_twice_at_once_is_passed_over_for_the_longer_time() -> None:
    refusals = Refusals()
    refusals.refused("t", LATER, 0.0)
    refusals.refused("t", LATER, 0.0)
    assert refusals.due() == 2.0
    refusals.refused("t", DENIED, 0.0)
    refusals.refused("t", LATER, 0.0)
    assert refusals.due() is None
    assert refusal_of(DENIED) is Refusal.DENIED


def test_a_message_that_is_wrong_in_itself_is_reported_once_for_its_topic_until_a_reload() -> None:
    refusals = Refusals()
    assert [refusals.unfit("event"), refusals.unfit("event"), refusals.unfit("state")] == [True, False, True]
    assert refusals.topics == set()
    refusals.reload(0.0)
    assert refusals.unfit("event")
