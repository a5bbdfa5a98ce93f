"""Which answers are not believed at once: what may be a second answer to the request before."""

from __future__ import annotations

import itertools
from math import inf

import pytest

from lfs10d.line.device import CONFIDENT_FROM, ResponseTimes
from lfs10d.line.doubtful_answers import LEAST_MARGIN, TRUST, TRUST_MOST, VAIN, DoubtfulAnswers
from lfs10d.modbus.duplicates import WATCHED, Duplicates
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import Fault, FaultCode
from tests.support.outcomes import ended

USUAL = 0.02
TOOK = 0.038
"""Request 8 ms, turnaround 20 ms, answer 10 ms."""


class Line:
    """A slave that always took 20 ms; each exchange is told by its begin."""

    def __init__(self, learned: int = CONFIDENT_FROM) -> None:
        self.duplicates = Duplicates()
        self.doubts = DoubtfulAnswers(self.duplicates)
        self.usual = ResponseTimes()
        for _ in range(learned):
            self.usual.learn(USUAL)

    def ask(
        self,
        began: float,
        turnaround: float = USUAL,
        *,
        code: FaultCode | None = None,
        unsolicited: int = 0,
        heard: bytes = b"x",
        timeout: float = 0.1,
    ) -> bool:
        outcome: Outcome = ended(
            ReadRegisters(1, 1, 2),
            asked=began,
            began=began,
            sent_end=began + 0.008,
            turnaround=None if code else turnaround,
            ended=began + 0.018 + turnaround,
            answer=None if code else (1, 2),
            fault=Fault(code, "failed") if code else None,
            heard=heard,
            unsolicited=unsolicited,
        )
        return self.doubts.exchanged(outcome, self.usual, timeout)

    def alone_until(self, now: float) -> float | None:
        return self.duplicates.rests_until(1, now)


@pytest.mark.parametrize(("turnaround", "doubtful"), [(0.02, False), (0.016, False), (0.014, True), (0.026, True)])
def test_right_behind_another_an_answer_out_of_the_usual_time_is_doubtful(turnaround: float, doubtful: bool) -> None:  # noqa: FBT001
    line = Line()
    assert not line.ask(1.0)
    assert line.ask(1.0 + TOOK + 0.004, turnaround) is doubtful
    assert (line.alone_until(1.1) is not None) is doubtful


def test_well_after_the_exchange_before_none_is_nor_while_no_usual_time_is_known() -> None:
    line = Line()
    assert not line.ask(1.0, 0.001)
    assert not line.ask(1.0 + 0.019 + WATCHED + 0.001, 0.001)
    young = Line(0)
    assert not young.ask(1.0)
    assert not young.ask(1.05, 0.001)


@pytest.mark.parametrize(
    ("learned", "outliers", "doubtful"), [(1, 0, True), (8, 1, False), (10, 1, True), (10, 2, False)]
)
def test_of_many_answers_two_must_have_taken_as_long_of_few_one(learned: int, outliers: int, doubtful: bool) -> None:  # noqa: FBT001
    line = Line(learned)
    for _ in range(outliers):
        line.usual.learn(0.06)
    assert not line.ask(1.0)
    assert line.ask(1.05, 0.06) is doubtful


def proved_after(usual: list[float], turnaround: float, began: float = 1.05) -> tuple[float, float]:
    """Return how long after its end an answer of 10 ms is proved, and the slave's own would have come."""
    line = Line(0)
    for each in usual:
        line.usual.learn(each)
    line.ask(1.0)
    assert not line.ask(began, turnaround)
    ended = began + 0.018 + turnaround
    return line.doubts.proved_at(1) - ended, line.doubts.own_by(1) - ended


def test_an_answer_is_held_for_as_long_as_bytes_may_lie_unread_and_its_own_comes_by_the_usual_times() -> None:
    """The own answer would begin behind it, at the usual time at the latest, and be as long."""
    late = [0.02] * 50 + [0.04] * 50
    assert proved_after(late, 0.02) == pytest.approx((WATCHED, 0.04 + LEAST_MARGIN - 0.02))
    assert proved_after([0.02, 0.02, 0.5], 0.02) == pytest.approx((WATCHED, WATCHED))


@pytest.mark.parametrize(
    ("usual", "turnaround", "began"),
    [([0.02] * 100, 0.02, 1.05), ([0.02, 0.04] * 50, 0.04, 1.05), ([0.02, 0.04] * 50, 0.02, 1.3), ([], 0.02, 1.05)],
)
def test_it_is_so_at_once_where_none_could_follow_it_or_nothing_was_asked_before(
    usual: list[float], turnaround: float, began: float
) -> None:
    assert proved_after(usual, turnaround, began) == (-inf, -inf)


def test_of_one_that_never_answered_nothing_is_to_be_proved() -> None:
    assert Line().doubts.proved_at(7) == -inf
    assert Line().doubts.own_by(7) == -inf


def test_it_is_left_alone_for_as_long_as_a_second_answer_may_take_or_its_own() -> None:
    for timeout, rest in ((0.1, WATCHED), (0.4, 0.4)):
        line = Line()
        line.ask(1.0)
        assert line.ask(1.05, 0.001, timeout=timeout)
        assert line.alone_until(1.1) == pytest.approx(1.069 + rest)


@pytest.mark.parametrize("code", [FaultCode.CRC, FaultCode.MALFORMED, FaultCode.COLLISION])
def test_after_bytes_in_place_of_an_answer_it_is_left_alone(code: FaultCode) -> None:
    line = Line()
    assert not line.ask(1.0, code=code)
    assert line.alone_until(1.1) == pytest.approx(1.038 + WATCHED)


def test_after_silence_or_an_exception_it_is_not() -> None:
    line = Line()
    line.ask(1.0, code=FaultCode.TIMEOUT, heard=b"")
    line.ask(1.1, code=FaultCode.EXCEPTION)
    assert line.alone_until(1.13) is None


def test_what_was_never_sent_teaches_nothing() -> None:
    line = Line()
    outcome = ended(ReadRegisters(1, 1, 2), began=None, heard=b"x", unsolicited=1, fault=Fault(FaultCode.COLLISION, ""))
    assert not line.doubts.exchanged(outcome, line.usual, 0.1)
    assert line.alone_until(0.3) is None


def test_noise_raises_a_doubt_and_is_trusted_ever_longer_where_that_was_in_vain() -> None:
    line = Line()
    doubts: list[float] = []
    for n in range(40_000):
        at = n * 0.1
        if line.alone_until(at) is None and line.ask(at, unsolicited=2):
            doubts.append(at)
    pauses = [later - earlier for earlier, later in itertools.pairwise(doubts)]
    assert max(pauses[: VAIN - 1]) < 1.0  # in vain once proves nothing: a second answer may come now and then only
    assert pauses[VAIN - 1] == pytest.approx(TRUST, abs=0.5)
    assert pauses[VAIN] == pytest.approx(2 * TRUST, abs=0.5)
    assert max(pauses) == pytest.approx(TRUST_MOST, abs=0.5)


def test_where_a_second_answer_came_noise_is_not_trusted() -> None:
    line = Line()
    line.ask(1.0)
    line.duplicates.answered(1, 1.038)
    assert line.ask(1.05, unsolicited=2)
    line.duplicates.answered(1, 1.088)
    line.duplicates.second(1, 1.12)
    assert not line.ask(1.4)
    assert line.ask(1.45, unsolicited=2)


def test_where_broken_answers_are_rare_they_are_trusted_once_some_were_in_vain() -> None:
    line = Line()
    for n in range(VAIN):
        line.ask(1.0 + n, code=FaultCode.CRC)
        assert line.alone_until(1.1 + n) is not None
        line.ask(1.3 + n)
    line.ask(5.0, code=FaultCode.CRC)
    assert line.alone_until(5.05) is None
    line.ask(5.1, code=FaultCode.CRC)  # so soon again
    assert line.alone_until(5.15) is not None


def test_broken_bytes_behind_an_answer_raise_a_doubt_until_that_was_in_vain_often_enough() -> None:
    line = Line()
    doubts = 0
    for n in range(VAIN + 2):
        line.ask(1.0 + n)
        at = 1.05 + n
        if line.doubts.doubt(1, at):
            doubts += 1
            assert line.alone_until(at) == pytest.approx(at + WATCHED)
        line.ask(1.3 + n)
    assert doubts == VAIN
