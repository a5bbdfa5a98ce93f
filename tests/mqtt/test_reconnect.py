"""When the next connection is tried, and in which version, in virtual time."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.mqtt.reasons import UNSUPPORTED_VERSION, Disconnect, DisconnectReason
from lfs10d.mqtt.reconnect import (
    AWAY_EVERY,
    HELD,
    SHORT_MOST,
    SILENT_FOR,
    TAKEN_OVER_FIRST,
    TAKEN_OVER_FORGOTTEN,
    Reconnect,
)
from lfs10d.mqtt.settings import Version

UNREACHABLE = Disconnect(DisconnectReason.UNREACHABLE, "")
WRONG_VERSION = Disconnect(DisconnectReason.WRONG_VERSION, "")
REFUSED = Disconnect(DisconnectReason.REFUSED, "", 0x87)
CLOSED = Disconnect(DisconnectReason.CLOSED, "")
LOST = Disconnect(DisconnectReason.LOST, "")
TAKEN_OVER = Disconnect(DisconnectReason.TAKEN_OVER, "")


def fresh(version: Version = Version.V5, nodes: int = 1) -> Reconnect:
    return Reconnect(version, lambda: 0.0, nodes)


def live(policy: Reconnect, start: float, seconds: float, ended: Disconnect = LOST) -> None:
    policy.accepted(start)
    policy.ended(ended, start + seconds)


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


# Several nodes


def test_nodes_are_tried_in_turn_at_once_until_all_have_failed() -> None:
    policy = fresh(nodes=3)
    tried = []
    for _ in range(7):
        now = max(policy.due, 0.0)
        tried.append((now, policy.node))
        policy.begun(now)
        policy.ended(UNREACHABLE, now)
    assert tried == [(0.0, 0), (0.0, 1), (0.0, 2), (1.0, 0), (1.0, 1), (1.0, 2), (2.0, 0)]


def test_the_node_that_accepts_us_is_kept_and_left_only_when_it_is_gone() -> None:
    policy = fresh(nodes=2)
    policy.ended(UNREACHABLE, 0.0)
    live(policy, 0.0, 100.0)
    assert (policy.node, policy.due) == (1, 100.0)
    live(policy, 100.0, 100.0)
    assert policy.node == 1
    policy.ended(UNREACHABLE, 200.0)
    assert (policy.node, policy.due) == (0, 200.0)


def test_nodes_whose_time_has_come_are_tried_together_and_the_one_that_answers_is_kept() -> None:
    policy = fresh(nodes=4)
    policy.begun(0.0)
    assert policy.beside(0.0) == ((1, 0.0), (2, 0.0), (3, 0.0))
    policy.opened(2)
    policy.ended(REFUSED, 0.0)
    assert (policy.node, policy.due, policy.beside(0.0)) == (3, 0.0, ((0, 0.0), (1, 0.0), (2, 1.0)))
    policy.begun(0.0)
    policy.unreached((0, 1, 2), 0.2)
    policy.ended(UNREACHABLE, 0.2)
    assert policy.due == AWAY_EVERY
    assert policy.beside(AWAY_EVERY) == ((1, 0.0), (2, 0.0), (3, 0.0))
    policy.opened(1)
    live(policy, 10.0, HELD)
    assert (policy.node, policy.due) == (1, 10.0 + HELD)


def test_a_node_that_refuses_us_is_left_out_when_its_time_is_far() -> None:
    policy = fresh(nodes=2)
    for _ in range(4):
        policy.node = 1
        policy.ended(REFUSED, 0.0)
    assert (policy.node, policy.beside(0.0)) == (0, ())
    assert policy.beside(4.0) == ((1, 4.0),)


def test_a_node_that_is_asked_in_3_1_1_is_asked_alone() -> None:
    policy = fresh(nodes=2)
    policy.begun(0.0)
    policy.opened(1)
    policy.ended(WRONG_VERSION, 0.0)
    assert (policy.version, policy.node, policy.beside(0.0)) == (Version.V311, 1, ())


def test_a_node_that_refuses_us_does_not_delay_the_others() -> None:
    policy = fresh(nodes=2)
    at: dict[int, list[float]] = {0: [], 1: []}
    while len(at[1]) < 10:
        now = max(policy.due, 0.0)
        at[policy.node].append(now)
        policy.begun(now)
        policy.ended(UNREACHABLE if policy.node else REFUSED, now)
    assert at[1] == [float(second) for second in range(10)]
    assert at[0] == [0.0, 1.0, 3.0, 7.0]


def test_each_node_is_asked_in_3_1_1_before_the_next() -> None:
    policy = fresh(nodes=2)
    tried = []
    for _ in range(5):
        tried.append((policy.node, policy.version))
        policy.ended(WRONG_VERSION, 0.0)
    assert tried == [(0, Version.V5), (0, Version.V311), (1, Version.V5), (1, Version.V311), (0, Version.V5)]


def test_a_node_on_which_a_connection_does_not_hold_is_left() -> None:
    policy = fresh(nodes=2)
    live(policy, 0.0, 0.5)
    assert (policy.node, policy.due) == (1, 0.5)


def test_taken_over_it_waits_whatever_other_nodes_there_are() -> None:
    policy = fresh(nodes=2)
    live(policy, 0.0, 100.0, TAKEN_OVER)
    assert policy.due == 100.0 + TAKEN_OVER_FIRST


def test_3_1_1_where_configured_is_the_only_one_tried() -> None:
    policy = fresh(Version.V311)
    assert policy.version is Version.V311
    policy.ended(WRONG_VERSION, 0.0)
    assert (policy.version, policy.due) == (Version.V311, 1.0)


def test_taken_over_it_waits_60_s_doubling_to_1_h() -> None:
    policy = fresh()
    now = 0.0
    waits = []
    for _ in range(8):
        live(policy, now, 500.0, TAKEN_OVER)
        waits.append(policy.due - now - 500.0)
        now = policy.due
    assert waits == [60.0, 120.0, 240.0, 480.0, 960.0, 1920.0, 3600.0, 3600.0]
    assert policy.duplicate


def test_a_duplicate_is_forgotten_when_the_connection_holds_longer_than_the_other_may_wait() -> None:
    policy = fresh()
    policy.held(0.0)
    live(policy, 0.0, 10.0, TAKEN_OVER)
    policy.held(1e9)
    assert policy.duplicate
    policy.accepted(70.0)
    policy.held(70.0 + 2 * TAKEN_OVER_FIRST - 1)
    assert policy.duplicate
    policy.held(70.0 + 2 * TAKEN_OVER_FIRST)
    assert not policy.duplicate


def test_after_two_hours_in_peace_the_wait_is_60_s_again() -> None:
    policy = fresh()
    live(policy, 0.0, 10.0, TAKEN_OVER)
    live(policy, 100.0, TAKEN_OVER_FORGOTTEN, TAKEN_OVER)
    assert policy.due == 100.0 + TAKEN_OVER_FORGOTTEN + TAKEN_OVER_FIRST


def live_shortly(policy: Reconnect, start: float, *, missed: bool = True) -> None:
    """Live for half a second; on arrival the broker had published our will, or not."""
    policy.accepted(start)
    if missed:
        policy.missed()
    policy.ended(LOST, start + 0.5)


def test_three_connections_in_a_row_that_the_broker_ends_are_a_duplicate() -> None:
    policy = fresh()
    for count in range(1, SHORT_MOST + 1):
        live_shortly(policy, 100.0 * count)
        assert policy.duplicate == (count == SHORT_MOST)
    assert policy.due == 100.0 * SHORT_MOST + 0.5 + TAKEN_OVER_FIRST


def test_once_suspected_the_next_that_does_not_hold_is_enough() -> None:
    policy = fresh()
    for count in range(SHORT_MOST):
        live_shortly(policy, 100.0 * count)
    live_shortly(policy, 1000.0)
    assert policy.due == 1000.5 + 2 * TAKEN_OVER_FIRST


@pytest.mark.parametrize("between", ["failure", "long life", "restart"])
def test_a_broker_that_comes_and_goes_is_no_duplicate(between: str) -> None:
    policy = fresh()
    for count in range(10):
        live_shortly(policy, 1000.0 * count, missed=between != "restart")
        if between == "failure":
            policy.ended(UNREACHABLE, 1000.0 * count + 6.0)
        elif between == "long life":
            live(policy, 1000.0 * count + 10.0, 600.0)
    assert not policy.duplicate


def test_two_gateways_with_one_id_meet_less_and_less_often() -> None:
    """Neither is told why its connection ends; each connect throws the other out, whose will is published."""
    gates = [fresh(), fresh()]
    now, inside = 0.0, 0
    gates[0].accepted(now)
    gates[1].due = 100.0
    connects = []
    while now < 4 * 3600.0:
        now = gates[1 - inside].due
        connects.append(now)
        gates[inside].ended(LOST, now)
        gates[1 - inside].accepted(now)
        gates[1 - inside].missed()
        inside = 1 - inside
    assert len(connects) < 40
    assert any(gate.duplicate for gate in gates)


@pytest.mark.parametrize(
    ("ended", "explained"),
    [
        (Disconnect(DisconnectReason.LOST, "", 0x87, by_message=True), False),
        (Disconnect(DisconnectReason.LOST, "", 0x8B), False),
        (LOST, True),
    ],
)
def test_a_broker_that_ends_connections_for_a_reason_or_a_message_is_no_duplicate_client(
    ended: Disconnect,
    explained: bool,  # noqa: FBT001 - a column of the table
) -> None:
    policy = fresh()
    for count in range(3 * SHORT_MOST):
        start = 1000.0 * count
        policy.accepted(start)
        policy.missed()
        policy.ended(ended, start + 1.0, explained=explained)
        assert not policy.duplicate
        assert policy.due - start - 1.0 < TAKEN_OVER_FIRST
