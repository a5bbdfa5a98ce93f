"""Another client with our id: waits that grow."""

from __future__ import annotations

import pytest

from lfs10d.mqtt.reasons import Disconnect, DisconnectReason
from lfs10d.mqtt.reconnect import (
    SHORT_MOST,
    TAKEN_OVER_FIRST,
    TAKEN_OVER_FORGOTTEN,
    Reconnect,
)
from tests.support.reconnects import LOST, TAKEN_OVER, UNREACHABLE, fresh, live


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
