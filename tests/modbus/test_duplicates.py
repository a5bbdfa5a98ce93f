"""Slaves for which two answers come to one request."""

from __future__ import annotations

import pytest

from lfs10d.modbus.duplicates import (
    AWAITED_MOST,
    CLEAN,
    LATEST,
    MARGIN,
    MISPLACED_LATEST,
    WATCHED,
    Duplicates,
    Twice,
)


def test_after_its_first_answer_a_slave_is_watched_once() -> None:
    duplicates = Duplicates()
    assert duplicates.rests_until(1, 0.0) is None
    assert duplicates.answered(1, 1.0) is False
    assert duplicates.rests_until(1, 1.1) == 1.0 + WATCHED
    assert duplicates.rests_until(1, 1.0 + WATCHED) is None
    assert duplicates.rests_until(2, 1.0) is None
    duplicates.answered(1, 2.0)
    assert duplicates.rests_until(1, 2.0) is None


def test_the_second_one_too_many_tells_once_and_the_slave_rests_until_it_has_come() -> None:
    duplicates = Duplicates()
    duplicates.answered(1, 1.0)
    assert duplicates.second(1, 1.04) is None
    assert duplicates.rests_until(1, 1.05) == 1.04 + WATCHED
    assert not duplicates.known(1)
    duplicates.answered(1, 2.0)
    assert duplicates.rests_until(1, 2.0) == 2.0 + WATCHED
    assert duplicates.second(1, 2.25) == Twice(1, 0.25)
    assert duplicates.known(1)
    duplicates.answered(1, 3.0)
    assert duplicates.rests_until(1, 3.0) == 3.0 + 1.25 * 0.25 + MARGIN
    assert duplicates.second(1, 3.2) is None


def test_what_is_long_after_or_before_an_answer_is_no_second_one() -> None:
    duplicates = Duplicates()
    assert duplicates.second(1, 0.5) is None
    for at in (1.0, 10.0, 20.0):
        duplicates.answered(1, at)
        assert duplicates.second(1, at + LATEST + 0.1) is None
        assert duplicates.second(1, at) is None
    assert not duplicates.known(1)
    assert duplicates.rests_until(1, 20.0) is None


def test_a_second_answer_to_a_barrier_counts_but_a_barrier_needs_no_rest() -> None:
    duplicates = Duplicates()
    duplicates.answered(1, 1.0, barrier=True)
    assert duplicates.rests_until(1, 1.0) is None
    duplicates.second(1, 1.04)
    duplicates.answered(1, 2.0, barrier=True)
    assert duplicates.rests_until(1, 2.0) is None
    assert duplicates.second(1, 2.04) is not None


def test_it_is_forgotten_after_enough_answers_with_none_behind_them() -> None:
    duplicates = Duplicates()
    for at in (1.0, 2.0):
        duplicates.answered(1, at)
        duplicates.second(1, at + 0.04)
    over = [duplicates.answered(1, 3.0 + n) for n in range(CLEAN + 3)]
    assert over == [False] * (CLEAN + 1) + [True, False]
    assert not duplicates.known(1)
    assert duplicates.rests_until(1, 100.0) is None


def test_a_single_one_is_forgotten_silently() -> None:
    duplicates = Duplicates()
    duplicates.answered(1, 1.0)
    duplicates.second(1, 1.04)
    assert not any(duplicates.answered(1, 2.0 + n) for n in range(CLEAN + 3))
    duplicates.answered(1, 90.0)
    assert duplicates.second(1, 90.04) is None


def test_another_device_or_an_opened_port_begins_anew() -> None:
    duplicates = Duplicates()
    for slave in (1, 2, 3):
        for at in (1.0, 2.0):
            duplicates.answered(slave, at)
            duplicates.second(slave, at + 0.04)
    duplicates.forget(1)
    assert [duplicates.known(slave) for slave in (1, 2, 3)] == [False, True, True]
    duplicates.forget()
    assert not any(duplicates.known(slave) for slave in (1, 2, 3))


def test_in_place_of_anothers_answer_only_what_comes_soon_is_a_second_one() -> None:
    duplicates = Duplicates()
    for at in (1.0, 2.0):
        duplicates.answered(1, at)
        duplicates.second(1, at + MISPLACED_LATEST + 0.01, misplaced=True)
    assert duplicates.extras(1) == 0
    duplicates.second(1, 2.0 + MISPLACED_LATEST - 0.01, misplaced=True)
    assert duplicates.extras(1) == 1


def test_how_long_a_second_answer_is_awaited() -> None:
    duplicates = Duplicates()
    assert duplicates.extras(1) == 0
    assert duplicates.awaited(1) is None
    duplicates.answered(1, 1.0)
    assert duplicates.awaited(1) is None
    duplicates.second(1, 1.04)
    assert duplicates.awaited(1) == WATCHED
    duplicates.answered(1, 2.0)
    duplicates.second(1, 2.04)
    assert duplicates.awaited(1) == pytest.approx(1.25 * 0.04 + MARGIN)
    duplicates.second(1, 2.0 + AWAITED_MOST)
    assert duplicates.awaited(1) is None


def test_what_it_was_asked_may_be_answered_still() -> None:
    duplicates = Duplicates()
    duplicates.rest(1, 2.0)
    duplicates.rest(1, 1.0)
    assert duplicates.rests_until(1, 1.5) == 2.0
    duplicates.answered(1, 3.0)
    assert duplicates.rests_until(1, 3.0) == 3.0 + WATCHED


def test_a_slave_is_watched_for_as_long_as_its_second_answer_takes_where_that_is_known() -> None:
    duplicates = Duplicates()
    assert duplicates.watched(1) == WATCHED
    for at in (1.0, 2.0):
        assert duplicates.watched(1) == WATCHED
        duplicates.answered(1, at)
        duplicates.second(1, at + 0.4)
    assert duplicates.watched(1) == pytest.approx(1.25 * 0.4 + MARGIN)
    assert duplicates.watched(2) == WATCHED
