"""Which answers have to be proved, and what proves them: their own may still come."""

from __future__ import annotations

from math import inf

import pytest

from lfs10d.line.doubtful_answers import OWN_MOST, TARDY, VAIN, YOUNG
from lfs10d.line.unproved_answers import PROVED_WITHIN
from lfs10d.modbus.duplicates import WATCHED
from lfs10d.modbus.outcome import LateAnswer
from lfs10d.modbus.request import ReadRegisters, WriteRegister
from lfs10d.reading import FaultCode
from tests.support.doubted_slaves import WHO, WIND, Line, jittery
from tests.support.outcomes import ended


def own_after(usual: list[float], turnaround: float, began: float = 1.05) -> float | None:
    """Return how long after its end an answer of 10 ms may still be followed by its own; None where it is proved."""
    line = Line(0)
    for each in usual:
        line.learn(each)
    line.ask(1.0)
    assert not line.ask(began, turnaround)
    if not line.doubts.unproved(1):
        return None
    ended = began + 0.018 + turnaround
    assert line.doubts.held_until(1) - ended == pytest.approx(max(WATCHED, line.doubts.own_by(1) - ended))
    return line.doubts.own_by(1) - ended


def test_an_answer_is_unproved_for_as_long_as_its_own_may_come_by_the_usual_times() -> None:
    """The own answer would begin behind it, a half later than any did at the latest."""
    assert own_after([0.02] * 50 + [0.04] * 50, 0.02) == pytest.approx(0.04 + 0.01 - 0.02 - 0.01)
    assert own_after([0.02, 0.02, 0.04], 0.02) == pytest.approx(YOUNG * 0.04 + 0.01 - 0.02 - 0.01)
    assert own_after([0.02] * 20 + [0.9], 0.02) == pytest.approx(OWN_MOST)


@pytest.mark.parametrize(
    ("usual", "turnaround", "began"),
    [([0.02] * 100, 0.02, 1.05), ([0.02, 0.024] * 50, 0.024, 1.05), ([0.02, 0.04] * 50, 0.02, 1.3), ([], 0.02, 1.05)],
)
def test_it_is_proved_at_once_where_none_could_follow_it_or_nothing_was_asked_before(
    usual: list[float], turnaround: float, began: float
) -> None:
    assert own_after(usual, turnaround, began) is None


def test_of_one_that_never_answered_nothing_is_to_be_proved() -> None:
    doubts = Line().doubts
    assert doubts.proved(7)
    assert not doubts.unproved(7)
    assert doubts.own_by(7) == -inf
    assert doubts.held_until(7) == -inf
    assert not doubts.overdue(7, 1.0)


def test_answers_stay_unproved_one_behind_the_other_until_one_looks_otherwise() -> None:
    line = jittery()
    for n in range(1, 8):
        assert not line.ask(1.0 + 0.05 * n, 0.03)
        assert line.doubts.unproved(1)
        assert line.doubts.proved(1) is (n == 1)
    assert line.doubts.overdue(1, 1.4 + PROVED_WITHIN)
    assert not line.ask(1.4, 0.03, request=WHO)
    assert line.doubts.proved(1)


def test_a_refusal_proves_them_too_but_not_one_that_may_still_be_followed() -> None:
    for exception, proved in ((2, True), (11, False)):
        line = jittery()
        line.ask(1.05, 0.03)
        line.refuse(1.1, exception)
        assert line.doubts.proved(1) is proved


def test_the_confirmation_of_another_write_proves_nothing_of_a_write() -> None:
    line = jittery()
    line.ask(1.05, 0.03, request=WriteRegister(1, 4, 1))
    line.ask(1.1, 0.03, request=WriteRegister(1, 4, 1))
    line.ask(1.15, 0.03, request=WriteRegister(1, 4, 1))
    assert not line.doubts.proved(1)


def test_they_are_proved_by_silence_once_their_own_is_over() -> None:
    line = jittery()
    line.ask(1.05, 0.03)
    line.ask(1.5, 0.03)
    assert line.doubts.proved(1)
    assert not line.doubts.unproved(1)


def test_while_it_does_not_answer_they_are_held_back() -> None:
    line = jittery()
    line.ask(1.05, 0.03)
    line.ask(1.12, code=FaultCode.TIMEOUT)
    assert not line.doubts.proved(1)
    assert line.doubts.held_until(1) == pytest.approx(1.12 + 0.038 + WATCHED)


def test_given_up_they_are_forgotten_and_the_slave_is_left_alone_unless_it_was_silent() -> None:
    for silent in (True, False):
        line = jittery()
        line.ask(1.05, 0.03)
        assert line.doubts.doubt(1, 1.2, silent=silent, own=True)
        assert not line.doubts.unproved(1)
        assert (line.alone_until(1.25) is None) is silent
    line = jittery()
    line.ask(1.05, 0.03)
    line.doubts.decided(1)
    assert not line.doubts.unproved(1)


def test_one_that_is_answered_twice_and_late_now_and_then_is_waited_for_longer() -> None:
    line = Line()
    line.ask(1.0)
    assert not line.ask(1.06, tardy=True)
    assert not line.doubts.unproved(1)
    line.duplicates.second(1, 1.1)
    line.duplicates.answered(1, 1.09)
    line.duplicates.second(1, 1.1)
    assert not line.ask(1.12, tardy=True)
    assert line.doubts.own_by(1) == pytest.approx(1.158 + TARDY)


def test_whoever_spoke_for_a_slave_its_next_answer_is_no_clean_one() -> None:
    late, own = LateAnswer(ReadRegisters(2, 1, 2), 0.3), LateAnswer(ReadRegisters(3, 5, 1), 0.3)
    for spoken in ("nobody", "another master", "a late answer"):
        line = jittery()
        if spoken == "another master":
            line.doubts.spoke(1, 1.95)
        elif spoken == "a late answer":
            outcome = ended(ReadRegisters(3, 1, 2), began=1.9, ended=1.95, late=(late, LateAnswer(WIND, 0.4), own))
            line.doubts.exchanged(outcome, line.usual, 0.1)
        line.ask(2.0, 0.03)
        assert line.doubts.unproved(1) is (spoken != "nobody")


def test_the_second_answer_of_one_that_is_known_to_be_answered_twice_does_not_make_the_next_one_unclean() -> None:
    for known in (False, True):
        line = jittery()
        if known:
            line.twice(0.5)
        line.doubts.spoke(1, 1.95, second=True)
        line.ask(2.0, 0.03)
        assert line.doubts.unproved(1) is not known


def test_with_another_frame_of_the_slave_beside_it_no_answer_is_believed_that_is_not_clean() -> None:
    line = Line()
    line.ask(1.0)
    line.doubts.spoke(1, 1.08, second=True)
    assert line.ask(1.06)


def test_where_answers_are_unproved_no_noise_is_trusted() -> None:
    line = jittery()
    at = 2.0
    for _ in range(VAIN + 1):
        line.ask(at, 0.03)
        line.ask(at + 0.08, 0.03, code=FaultCode.CRC)
        at += 1.0
    line.ask(at, 0.03)
    assert not line.ask(at + 0.08, 0.03, beside=bytes(1))
    line.ask(at + 0.16, 0.03)
    assert line.doubts.unproved(1)
    assert line.ask(at + 0.2, 0.03, beside=bytes(1))
