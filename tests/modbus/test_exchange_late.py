"""Answers to earlier requests: dropped, told, and never taken for ours."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lfs10d.modbus.outcome import LateAnswer
from lfs10d.modbus.pending import Pending
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import FaultCode
from tests.support.exchanges import (
    ANSWER,
    BROKEN,
    HUSH,
    LATE,
    MOVE,
    PLAIN,
    REFUSED,
    RTU,
    SENT_END,
    T9600,
    VALUES,
    WHO,
    attempt,
    carry_out,
    code,
    framed,
)

AFTER_WHO = replace(PLAIN, earlier=(Pending(WHO, RTU, -0.3),))


def test_a_late_answer_is_dropped_and_told_and_ours_still_comes() -> None:
    outcome = carry_out(AFTER_WHO, [(0.02, LATE), (0.1, ANSWER)])
    assert outcome.answer == VALUES
    assert outcome.late == (LateAnswer(WHO, 0.02 + 0.3),)
    assert outcome.unsolicited == 0
    assert not outcome.ambiguous


def test_a_late_answer_alone_is_late_at_the_time_out() -> None:
    outcome = carry_out(AFTER_WHO, [(0.02, LATE)])
    assert code(outcome) is FaultCode.LATE
    assert outcome.ended == pytest.approx(SENT_END + 0.2)
    assert not outcome.answered


def test_after_a_late_answer_the_slave_gets_its_usual_time_again() -> None:
    outcome = carry_out(AFTER_WHO, [(SENT_END + 0.199, LATE), (SENT_END + 0.22, ANSWER)])
    assert outcome.answer == VALUES


OTHER = ReadRegisters(4, 0x0001, 2)
LATE_OTHER = framed("040304414FD70A")
AFTER_OTHER = replace(PLAIN, elsewhere={4: (Pending(OTHER, RTU, -0.3),)})


@pytest.mark.parametrize(
    ("arrivals", "fault"),
    [
        pytest.param([(0.05, LATE_OTHER), (0.1, ANSWER)], None, id="ours still comes"),
        pytest.param([(0.05, ANSWER + LATE_OTHER)], None, id="behind ours"),
        pytest.param([(0.05, LATE_OTHER)], FaultCode.LATE, id="alone"),
    ],
)
def test_a_late_answer_of_another_slave_is_dropped_and_told(
    arrivals: list[tuple[float, bytes]], fault: FaultCode | None
) -> None:
    outcome = carry_out(AFTER_OTHER, arrivals)
    assert outcome.late == (LateAnswer(OTHER, 0.05 + 0.3),)
    assert code(outcome) is fault
    assert outcome.unsolicited == 0


def test_a_late_answer_of_another_slave_gives_ours_no_more_time() -> None:
    outcome = carry_out(AFTER_OTHER, [(SENT_END + 0.199, LATE_OTHER)])
    assert [late.request for late in outcome.late] == [OTHER]
    assert outcome.ended == pytest.approx(SENT_END + 0.199 + HUSH)


def test_late_answers_of_other_slaves_are_told_of_a_babbling_line_too() -> None:
    each = replace(AFTER_OTHER, timeout=0.01)
    outcome = carry_out(each, [(0.001, LATE_OTHER), *((0.002 * n, b"\xff") for n in range(1, 9))], quiet_since=0.0)
    assert code(outcome) is FaultCode.COLLISION
    assert [late.request for late in outcome.late] == [OTHER]


def test_a_late_answer_in_the_silence_is_told_too() -> None:
    outcome = carry_out(AFTER_WHO, [(0.001, LATE), (0.1, ANSWER)], quiet_since=0.0)
    assert outcome.answer == VALUES
    assert [late.request for late in outcome.late] == [WHO]
    assert outcome.began == pytest.approx(0.001 + T9600.gap)


def test_a_late_answer_while_our_request_is_on_its_way_is_told_too() -> None:
    outcome = carry_out(AFTER_WHO, [(0.002, LATE)])
    assert code(outcome) is FaultCode.LATE


def test_noise_beside_a_late_answer_is_still_late_but_a_broken_answer_is_not() -> None:
    assert code(carry_out(AFTER_WHO, [(0.02, LATE + b"\xff")])) is FaultCode.LATE
    assert code(carry_out(AFTER_WHO, [(0.02, LATE + BROKEN)])) is FaultCode.CRC


def test_two_answers_of_one_shape_are_two_late_answers() -> None:
    each = replace(PLAIN, earlier=(Pending(WHO, RTU, -0.6), Pending(WHO, RTU, -0.3)))
    outcome = carry_out(each, [(0.02, LATE), (0.03, LATE), (0.04, LATE), (0.1, ANSWER)])
    assert [late.latency for late in outcome.late] == [pytest.approx(0.62), pytest.approx(0.33)]
    assert outcome.answer == VALUES
    assert outcome.unsolicited == len(LATE)


def test_an_older_answer_cannot_follow_a_younger_one() -> None:
    """A slave answers in order."""
    older, younger = ReadRegisters(1, 0x0001, 3), WHO
    each = replace(PLAIN, earlier=(Pending(older, RTU, -0.6), Pending(younger, RTU, -0.3)))
    outcome = carry_out(each, [(0.02, LATE), (0.022, framed("010306000100020003"))])
    assert [late.request for late in outcome.late] == [younger]
    assert code(outcome) is FaultCode.MALFORMED


def test_an_exception_may_be_that_of_an_earlier_request() -> None:
    assert carry_out(AFTER_WHO, [(0.02, REFUSED)]).ambiguous
    assert not carry_out(AFTER_WHO, [(0.02, LATE + REFUSED)]).ambiguous
    of_a_write = replace(PLAIN, earlier=(Pending(MOVE, RTU, -0.3),))
    assert not carry_out(of_a_write, [(0.02, REFUSED)]).ambiguous


def test_the_exception_of_an_earlier_write_is_late() -> None:
    each = replace(PLAIN, earlier=(Pending(MOVE, RTU, -0.3),))
    assert [late.request for late in carry_out(each, [(0.02, framed("018602"))]).late] == [MOVE]


def test_an_answer_that_another_earlier_request_could_have_is_marked() -> None:
    other = ReadRegisters(1, 0x0004, 1)
    asked = replace(attempt(WHO), earlier=(Pending(other, RTU, -0.3),))
    assert carry_out(asked, [(0.02, LATE)]).ambiguous
    same = replace(attempt(WHO), earlier=(Pending(WHO, RTU, -0.3),))
    outcome = carry_out(same, [(0.02, LATE)])
    assert (outcome.answer, outcome.ambiguous) == ((7,), False)
