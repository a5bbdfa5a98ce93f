"""When the next connection is tried, and in which version, in virtual time."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.mqtt.reasons import UNSUPPORTED_VERSION, Disconnect, DisconnectReason
from lfs10d.mqtt.reconnect import (
    AWAY_EVERY,
    HELD,
    SILENT_FOR,
    Reconnect,
)
from lfs10d.mqtt.settings import Version
from tests.support.reconnects import REFUSED, UNREACHABLE, WRONG_VERSION, fresh, live

CLOSED = Disconnect(DisconnectReason.CLOSED, "")


def test_the_first_attempt_is_at_once() -> None:
    assert fresh().due < 0.0


@pytest.mark.parametrize("took", [0.0, 0.4, 1.0, 5.0])
def test_a_broker_that_is_away_is_tried_every_second_for_ever(took: float) -> None:
    """So that we are back within 3 s of its return (contract, section 3); an attempt may have taken 5 s itself."""
    policy = fresh()
    now = 100.0
    for _ in range(100):
        policy.begun(now)
        policy.ended(UNREACHABLE, now + took)
        assert policy.due == max(now + AWAY_EVERY, now + took)
        now = policy.due


def test_attempts_that_are_refused_are_1_2_4_up_to_30_s_apart() -> None:
    policy = fresh()
    delays = []
    for _ in range(7):
        policy.ended(REFUSED, 100.0)
        delays.append(policy.due - 100.0)
    assert delays == [1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0]


@pytest.mark.parametrize("ended", [UNREACHABLE, REFUSED])
@given(chance=st.floats(0, 1))
def test_chance_shortens_a_delay_by_at_most_a_quarter(ended: Disconnect, chance: float) -> None:
    policy = Reconnect(Version.V5, lambda: chance)
    policy.begun(0.0)
    policy.ended(ended, 0.0)
    assert 0.75 <= policy.due <= 1.0


def test_a_connection_that_held_is_renewed_at_once_and_refusals_start_from_1_s_again() -> None:
    policy = fresh()
    for _ in range(5):
        policy.ended(REFUSED, 0.0)
    live(policy, 100.0, HELD)
    assert policy.due == 100.0 + HELD
    policy.ended(REFUSED, 111.0)
    assert policy.due == 112.0


def test_a_broker_that_dropped_us_and_then_went_away_has_refused_nothing() -> None:
    policy = fresh()
    for _ in range(5):
        live(policy, 100.0, 0.5)
    policy.begun(200.0)
    policy.ended(UNREACHABLE, 200.0)
    live(policy, 201.0, 0.5)
    assert policy.due == 202.5


def test_a_connection_that_does_not_hold_is_not_renewed_at_once() -> None:
    policy = fresh()
    live(policy, 100.0, 0.5)
    assert policy.due == 101.5
    live(policy, 101.5, 0.5)
    assert policy.due == 104.0


def test_a_broker_that_refuses_5_is_asked_in_3_1_1_at_once() -> None:
    policy = fresh()
    policy.ended(WRONG_VERSION, 7.0)
    assert (policy.version, policy.due) == (Version.V311, 7.0)


def test_each_round_begins_with_5_again() -> None:
    policy = fresh()
    policy.ended(WRONG_VERSION, 0.0)
    live(policy, 0.0, 100.0)
    assert policy.version is Version.V5
    policy.ended(WRONG_VERSION, 100.0)
    assert (policy.version, policy.due) == (Version.V311, 100.0)
    policy.begun(100.0)
    policy.ended(WRONG_VERSION, 100.0)
    assert (policy.version, policy.due) == (Version.V5, 101.0)


def test_a_broker_that_has_spoken_5_and_says_nothing_now_is_asked_in_5_again() -> None:
    policy = fresh()
    live(policy, 0.0, HELD)
    for now in (100.0, 200.0, 300.0):
        policy.begun(now)
        policy.ended(WRONG_VERSION, now)
        assert (policy.version, policy.due) == (Version.V5, now + AWAY_EVERY)


def test_a_broker_that_has_spoken_5_and_refuses_it_in_so_many_words_is_asked_in_3_1_1_at_once() -> None:
    policy = fresh()
    live(policy, 0.0, HELD)
    policy.ended(Disconnect(DisconnectReason.WRONG_VERSION, "", UNSUPPORTED_VERSION), 100.0)
    assert (policy.version, policy.due) == (Version.V311, 100.0)


def test_a_broker_that_spoke_5_and_says_nothing_for_long_is_taken_for_another_one() -> None:
    policy = fresh()
    live(policy, 0.0, HELD)
    for now in (100.0, 400.0, 100.0 + SILENT_FOR):
        policy.ended(WRONG_VERSION, now)
        assert policy.version == Version.V5
    policy.ended(WRONG_VERSION, 800.0)
    assert (policy.version, policy.due) == (Version.V311, 800.0)
    for delay in (1.0, 2.0):
        policy.ended(WRONG_VERSION, 800.0)
        assert (policy.version, policy.due) == (Version.V5, 800.0 + delay)
        policy.ended(WRONG_VERSION, 800.0)
        assert policy.version is Version.V311


@pytest.mark.parametrize("between", ["accepted", "gone"])
def test_the_silence_of_a_broker_is_forgotten_when_it_speaks_or_is_gone(between: str) -> None:
    policy = fresh()
    live(policy, 0.0, HELD)
    policy.ended(WRONG_VERSION, 100.0)
    if between == "accepted":
        live(policy, 200.0, HELD)
    else:
        policy.ended(UNREACHABLE, 200.0)
    policy.ended(WRONG_VERSION, 1000.0)
    assert policy.version is Version.V5


def test_a_broker_that_closes_without_a_word_is_away_if_it_has_accepted_us_before() -> None:
    policy = fresh()
    policy.ended(CLOSED, 100.0)
    policy.ended(CLOSED, 100.0)
    assert policy.due == 102.0
    live(policy, 200.0, HELD)
    for now in (300.0, 600.0, 900.0):
        policy.begun(now)
        policy.ended(CLOSED, now)
        assert policy.due == now + AWAY_EVERY
    for delay in (1.0, 2.0, 4.0):
        policy.ended(CLOSED, 901.0)
        assert policy.due == 901.0 + delay


def test_3_1_1_where_configured_is_the_only_one_tried() -> None:
    policy = fresh(Version.V311)
    assert policy.version is Version.V311
    policy.ended(WRONG_VERSION, 0.0)
    assert (policy.version, policy.due) == (Version.V311, 1.0)
