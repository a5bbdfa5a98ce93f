"""Adapters that return our own bytes, always, never or unknown."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lfs10d.modbus.echo import Echo
from lfs10d.reading import FaultCode
from tests.support.exchanges import (
    ANSWER,
    BROKEN,
    CONFIRMED,
    ECHOING,
    HUSH,
    MOVE,
    PLAIN,
    REFUSED,
    REQUEST,
    SENT_END,
    UNKNOWN,
    VALUES,
    Attempt,
    attempt,
    byte_by_byte,
    carry_out,
    code,
    framed,
)


@pytest.mark.parametrize("each", [ECHOING, UNKNOWN, PLAIN])
@pytest.mark.parametrize("piecewise", [True, False])
def test_an_echo_hides_no_answer(each: Attempt, *, piecewise: bool) -> None:
    echo = byte_by_byte(REQUEST, 0.0) if piecewise else [(SENT_END + 0.001, REQUEST)]
    outcome = carry_out(each, echo + byte_by_byte(ANSWER, SENT_END + 0.005))
    assert outcome.answer == VALUES
    assert outcome.echoed is True


@pytest.mark.parametrize("each", [ECHOING, UNKNOWN])
def test_echo_and_answer_in_one_piece_are_taken_apart(each: Attempt) -> None:
    outcome = carry_out(each, [(0.03, REQUEST + ANSWER)])
    assert (outcome.answer, outcome.echoed, outcome.unsolicited) == (VALUES, True, 0)


@pytest.mark.parametrize("each", [ECHOING, UNKNOWN])
def test_nothing_at_all_is_a_timeout_on_an_echoing_adapter_too(each: Attempt) -> None:
    assert code(carry_out(each, [])) is FaultCode.TIMEOUT


@pytest.mark.parametrize("each", [ECHOING, UNKNOWN])
def test_nothing_but_echo_is_a_timeout(each: Attempt) -> None:
    outcome = carry_out(each, byte_by_byte(REQUEST, 0.0))
    assert code(outcome) is FaultCode.TIMEOUT
    assert outcome.echoed is True
    assert outcome.ended == pytest.approx(SENT_END + 0.2)


def test_a_missing_echo_is_proved_by_an_answer_only() -> None:
    assert carry_out(UNKNOWN, [(0.03, ANSWER)]).echoed is False
    assert carry_out(UNKNOWN, [(0.03, REFUSED)]).echoed is False
    assert carry_out(UNKNOWN, [(0.03, BROKEN)]).echoed is None
    assert carry_out(UNKNOWN, []).echoed is None


def test_an_echo_behind_noise_proves_nothing() -> None:
    assert carry_out(UNKNOWN, [(0.03, b"\x00" + REQUEST + ANSWER)]).echoed is None


@pytest.mark.parametrize("latency", [0.0, 0.016])
def test_a_changed_echo_is_a_collision(latency: float) -> None:
    changed = REQUEST[:4] + b"\x55" + REQUEST[5:]
    outcome = carry_out(ECHOING, [(at + latency, byte) for at, byte in byte_by_byte(changed, 0.0)])
    assert code(outcome) is FaultCode.COLLISION


def test_an_echo_cut_short_is_a_collision() -> None:
    assert code(carry_out(ECHOING, byte_by_byte(REQUEST[:5], 0.0))) is FaultCode.COLLISION


def test_a_changed_echo_hides_no_answer_of_a_read() -> None:
    outcome = carry_out(ECHOING, [(0.009, b"\x55" + REQUEST[1:]), (0.03, ANSWER)])
    assert (outcome.answer, outcome.echoed) == (VALUES, False)


def test_an_echo_expected_in_vain_hides_no_answer_of_a_read() -> None:
    assert carry_out(ECHOING, [(0.03, ANSWER)]).answer == VALUES


@pytest.mark.parametrize("echo", [Echo.ON, Echo.UNKNOWN])
def test_a_write_needs_echo_and_answer(echo: Echo) -> None:
    each = replace(attempt(MOVE), echo=echo)
    both = carry_out(each, [(0.009, CONFIRMED), (0.03, CONFIRMED)])
    assert (both.answer, both.echoed) == ((7,), True)
    one = carry_out(each, [(0.009, CONFIRMED)])
    assert code(one) is FaultCode.TIMEOUT
    assert one.echoed is (True if echo is Echo.ON else None)
    changed = carry_out(each, [(0.009, b"\x00" + CONFIRMED)])
    assert code(changed) is FaultCode.COLLISION
    refused = carry_out(each, [(0.009, CONFIRMED), (0.03, framed("018602"))])
    assert code(refused) is FaultCode.EXCEPTION


def test_a_cut_answer_that_looks_like_echo_so_far_is_given_up_like_any() -> None:
    outcome = carry_out(UNKNOWN, [(0.03, ANSWER[:2])])
    assert code(outcome) is FaultCode.MALFORMED
    assert outcome.ended == pytest.approx(0.03 + HUSH)
    assert outcome.answered
