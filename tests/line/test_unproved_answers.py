"""An answer is unproved until its slave was asked again after its own would have come, or answered something else."""

from __future__ import annotations

from math import inf

from lfs10d.line.unproved_answers import PROVED_WITHIN, UnprovedAnswers

WIND, WHO = (3, 4), (3, 2)


def test_at_first_there_is_none() -> None:
    none = UnprovedAnswers()
    assert not none.answers
    assert none.own_by == -inf
    assert not none.overdue(9.0)
    none.answered(1.0, WIND)
    assert not none.answers


def test_it_is_proved_by_the_next_answer_if_that_was_asked_for_when_its_own_could_not_come_any_more() -> None:
    answers = UnprovedAnswers()
    answers.add(WIND, 1.0, 1.05)
    answers.answered(1.04, WIND)
    assert answers.answers
    answers.answered(1.05, WIND)
    assert not answers.answers


def test_none_is_proved_before_the_last_one_is() -> None:
    answers = UnprovedAnswers()
    answers.add(WIND, 1.0, 1.05)
    answers.add(WIND, 1.04, 1.1)
    assert answers.own_by == 1.1
    answers.answered(1.06, WIND)
    assert answers.overdue(1.01 + PROVED_WITHIN)
    answers.answered(1.1, WIND)
    assert not answers.answers


def test_an_answer_that_looks_otherwise_than_all_of_them_proves_them_all() -> None:
    answers = UnprovedAnswers()
    answers.add(WIND, 1.0, 2.0)
    answers.add(WHO, 1.1, 2.0)
    answers.answered(1.2, WIND)
    answers.answered(1.2, WHO)
    assert answers.answers
    answers.answered(1.2, (3, 6))
    assert not answers.answers


def test_the_oldest_may_wait_for_so_long_only() -> None:
    answers = UnprovedAnswers()
    answers.add(WIND, 1.0, 2.0)
    answers.add(WIND, 1.2, 2.0)
    assert not answers.overdue(0.99 + PROVED_WITHIN)
    assert answers.overdue(1.01 + PROVED_WITHIN)


def test_what_was_given_up_waits_for_nothing() -> None:
    answers = UnprovedAnswers()
    answers.add(WIND, 1.0, 2.0)
    answers.forget()
    assert not answers.answers
