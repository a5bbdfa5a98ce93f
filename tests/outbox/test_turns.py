"""Turns by weight."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.outbox.turns import (
    CHANGES,
    CLEARINGS,
    HISTORY,
    LEAST_WEIGHT,
    LIVE,
    MESSAGES,
    REFRESH_WEIGHT,
    REFRESHES,
    TRACES,
    WEIGHT,
    Turns,
    weight,
)

ALL = range(3)


def test_where_nobody_has_anything_all_begin_level_with_who_went_last() -> None:
    """As if each had been passed by itself."""
    together, apart = Turns(3), Turns(3)
    for turns in (together, apart):
        for number in (0, 1, 1):
            turns.went(number, 1)
    assert together.order([]) == []
    for number in apart.order(ALL):
        apart.passed(number)
    assert together.order(ALL) == apart.order(ALL) == [0, 2, 1]
    for turns in (together, apart):
        turns.went(0, 0.25)
    assert together.order(ALL) == apart.order(ALL)


def test_only_those_that_wait_have_a_turn() -> None:
    turns = Turns(3)
    turns.went(0, 1)
    assert turns.order([0]) == [0]
    assert turns.order([0, 2]) == [2, 0]
    assert turns.order([0, 2], first=2) == [0, 2]


def test_equals_go_in_their_order_and_then_in_turn() -> None:
    turns = Turns(3)
    went = []
    for _ in range(6):
        number = turns.order(ALL)[0]
        turns.went(number, 8)
        went.append(number)
    assert went == [0, 1, 2, 0, 1, 2]


@given(st.lists(st.integers(1, 64), min_size=2, max_size=6))
def test_each_has_its_part_of_the_messages(weights: list[int]) -> None:
    turns = Turns(len(weights))
    went: Counter[int] = Counter()
    for _ in range(3 * sum(weights)):
        number = turns.order(range(len(weights)))[0]
        turns.went(number, weights[number])
        went[number] += 1
    assert all(abs(went[number] - 3 * weight) <= 1 for number, weight in enumerate(weights))


def test_a_class_that_had_nothing_has_saved_no_turns() -> None:
    turns = Turns(2)
    for _ in range(100):
        turns.order([0])
        turns.went(0, 1)
    went = []
    for _ in range(4):
        number = turns.order([0, 1])[0]
        turns.went(number, 1)
        went.append(number)
    assert went == [1, 0, 1, 0]


def test_a_class_that_was_never_asked_owes_and_is_owed_nothing() -> None:
    turns = Turns(2)
    for _ in range(100):
        turns.went(0, 1)
    turns.went(1, 1)
    assert turns.order([0, 1]) == [0, 1]


def test_the_first_classes_go_before_the_others() -> None:
    turns = Turns(4)
    for _ in range(5):
        turns.went(0, 1)
    assert turns.order(range(4), first=2) == [1, 0, 2, 3]
    assert turns.order(range(4)) == [1, 2, 3, 0]


@pytest.mark.parametrize(
    ("number", "bursting", "expected"),
    [
        (CHANGES, False, WEIGHT),
        (CHANGES, True, 2 * WEIGHT),
        (MESSAGES, False, WEIGHT),
        (LIVE, True, WEIGHT),
        (HISTORY, False, 4 * WEIGHT),
        (HISTORY, True, WEIGHT),
        (REFRESHES, False, REFRESH_WEIGHT),
        (TRACES, False, LEAST_WEIGHT),
        (CLEARINGS, True, LEAST_WEIGHT),
    ],
)
def test_the_weight_of_a_class(number: int, *, bursting: bool, expected: int) -> None:
    assert weight(number, bursting=bursting, level=4) == expected
