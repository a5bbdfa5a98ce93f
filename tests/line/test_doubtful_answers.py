"""Which answers are not believed at once: what may be a second answer to the request before."""

from __future__ import annotations

import itertools

import pytest

from lfs10d.line.doubtful_answers import TRUST, TRUST_MOST, VAIN
from lfs10d.modbus.duplicates import WATCHED
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import Fault, FaultCode
from tests.support.doubted_slaves import SENT, TOOK, Line, jittery
from tests.support.outcomes import ended


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
        line.learn(0.06)
    assert not line.ask(1.0)
    assert line.ask(1.05, 0.06) is doubtful


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
    line.ask(1.0, code=FaultCode.TIMEOUT)
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
        if line.alone_until(at) is None and line.ask(at, beside=bytes(2)):
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
    assert line.ask(1.05, beside=bytes(2))
    line.duplicates.answered(1, 1.088)
    line.duplicates.second(1, 1.12)
    line.duplicates.answered(1, 1.438)
    assert not line.ask(1.4)
    assert line.ask(1.45, beside=bytes(2))


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


def test_broken_bytes_behind_an_unproved_answer_raise_no_doubt_where_noise_is_trusted() -> None:
    for second, doubtful in ((False, False), (True, True)):
        line = jittery()
        for n in range(VAIN):
            line.ask(2.0 + n, 0.03, code=FaultCode.CRC)
        if second:
            line.doubts.spoke(1, 5.0, second=True)
        line.ask(6.0, 0.03)
        line.ask(6.05, 0.03)
        assert line.doubts.doubt(1, 6.1, silent=False, own=False) is doubtful
        assert line.doubts.unproved(1) is not doubtful
        assert line.doubts.doubt(1, 6.1, silent=False, own=True)
        assert line.doubts.doubt(1, 6.1, silent=True, own=True)


def test_a_clean_answer_is_believed_beside_noise_but_not_beside_what_may_be_a_broken_one() -> None:
    for beside, doubtful in ((b"\x07" * 3, False), (b"\x01\x03\x04", True), (b"\x07" * 9, True), (SENT, False)):
        assert Line().ask(1.0, beside=beside) is doubtful


def test_what_is_explained_by_another_master_raises_no_doubt_unless_it_begins_as_an_answer() -> None:
    for beside, doubtful in ((b"\x07" * 30, False), (b"\x01\x03\x04", True)):
        line = Line()
        line.ask(1.0)
        assert line.ask(1.05, beside=beside, explained=True) is doubtful
    line = Line()
    line.ask(1.0, code=FaultCode.CRC, explained=True, beside=bytes(3))
    assert line.alone_until(1.1) is None
