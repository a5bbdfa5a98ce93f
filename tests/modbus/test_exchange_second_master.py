"""Another master asks the same slave between our request and its answer: no frame says whose answer it is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lfs10d.modbus.echo import Echo
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import FaultCode
from tests.support.exchanges import (
    ANSWER,
    CONFIRMED,
    MOVE,
    PLAIN,
    REFUSED,
    REQUEST,
    RTU,
    VALUES,
    attempt,
    carry_out,
    code,
)

SAME_COUNT = RTU.encode(ReadRegisters(1, 0x0010, 2))
ELSEWHERE = RTU.encode(ReadRegisters(4, 0x0001, 2))
PROVED = replace(PLAIN, echo_proved=True)


@pytest.mark.parametrize("answer", [ANSWER, REFUSED])
@pytest.mark.parametrize("request_", [SAME_COUNT, RTU.encode(MOVE)])
def test_an_answer_behind_it_is_a_collision_and_ours_stays_pending(answer: bytes, request_: bytes) -> None:
    outcome = carry_out(PROVED, [(0.03, request_), (0.045, answer)])
    assert code(outcome) is FaultCode.COLLISION
    assert not outcome.answered
    assert outcome.ended == 0.045
    assert b"".join(piece for piece, _ in outcome.strays) == request_


def test_one_that_equals_ours_is_another_masters_where_the_adapter_has_no_echo() -> None:
    assert code(carry_out(PROVED, [(0.03, REQUEST), (0.045, ANSWER)])) is FaultCode.COLLISION
    unproved = carry_out(PLAIN, [(0.01, REQUEST), (0.03, ANSWER)])
    assert unproved.answer == VALUES
    assert unproved.strays == ()
    assert code(carry_out(PLAIN, [(0.01, REQUEST), (0.03, REQUEST), (0.045, ANSWER)])) is FaultCode.COLLISION


def test_behind_our_echo_one_that_equals_ours_is_another_masters() -> None:
    echoing = replace(PLAIN, echo=Echo.ON, echo_proved=True)
    assert carry_out(echoing, [(0.01, REQUEST), (0.03, ANSWER)]).answer == VALUES
    assert code(carry_out(echoing, [(0.01, REQUEST), (0.03, REQUEST), (0.045, ANSWER)])) is FaultCode.COLLISION
    assert carry_out(echoing, [(0.01, b"\x00" + REQUEST), (0.03, ANSWER)]).answer == VALUES


def test_a_request_to_another_slave_changes_nothing() -> None:
    outcome = carry_out(PROVED, [(0.03, ELSEWHERE), (0.045, ANSWER)])
    assert outcome.answer == VALUES
    assert b"".join(piece for piece, _ in outcome.strays) == ELSEWHERE


def test_one_behind_the_answer_changes_nothing() -> None:
    assert carry_out(PROVED, [(0.03, ANSWER + SAME_COUNT)]).answer == VALUES


def test_without_an_answer_it_is_a_collision_too() -> None:
    assert code(carry_out(PROVED, [(0.03, SAME_COUNT)])) is FaultCode.COLLISION


def test_one_right_before_ours_that_is_not_answered_yet_counts_too() -> None:
    before = carry_out(PROVED, [(0.0, SAME_COUNT), (0.03, ANSWER)], quiet_since=0.0)
    assert code(before) is FaultCode.COLLISION
    answered = carry_out(PROVED, [(0.0, SAME_COUNT + ANSWER), (0.03, ANSWER)], quiet_since=0.0)
    assert answered.answer == VALUES


def test_the_confirmation_of_a_write_says_what_it_confirms() -> None:
    assert carry_out(attempt(MOVE), [(0.03, SAME_COUNT), (0.045, CONFIRMED)]).answer is not None
