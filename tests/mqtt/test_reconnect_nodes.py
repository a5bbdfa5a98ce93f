"""Several nodes of a broker: tried in turn, kept, left."""

from __future__ import annotations

from lfs10d.mqtt.reconnect import (
    AWAY_EVERY,
    HELD,
    TAKEN_OVER_FIRST,
)
from lfs10d.mqtt.settings import Version
from tests.support.reconnects import REFUSED, TAKEN_OVER, UNREACHABLE, WRONG_VERSION, fresh, live

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
