"""What may still be answered is remembered, and nothing that could be confused with it is believed."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.modbus.outcome import LateAnswer
from lfs10d.modbus.pending import EQUALS_KEPT, OTHER_RATE, QUIET_LEAST
from lfs10d.modbus.request import ReadRegisters, Request, WriteRegister
from lfs10d.reading import Fault, FaultCode
from tests.support.outcomes import ended
from tests.support.pending_lines import PLAIN, RTU, WHO, WIND, Line

WHERE = ReadRegisters(1, 0x0004, 1)
"""Of the shape of `WHO`."""
OTHER = ReadRegisters(2, 0x0001, 2)
EXCHANGE = 0.02
"""s between two requests at least: no two were ever sent at the same moment."""


def test_an_answer_leaves_nothing_pending(line: Line) -> None:
    line.answered(WIND, 0.0)
    assert line.waiting() == []
    assert line.free(WIND, 0.2)
    assert not line.pending.by_slave


def test_after_silence_only_another_shape_may_be_asked(line: Line) -> None:
    line.silent(WIND, 0.0)
    assert line.pending.confusable(WIND, RTU)
    assert not line.pending.confusable(WHO, RTU)
    assert not line.pending.confusable(OTHER, RTU)
    assert list(line.pending.by_slave) == [1]


def test_an_answered_barrier_ends_it_once_the_silent_request_has_lingered(line: Line) -> None:
    line.silent(WIND, 0.0)
    line.answered(WHO, 0.3)
    assert not line.pending.confusable(WIND, RTU)
    assert line.pending.lingering_until(WIND, RTU, 0.6) == 1.0
    assert line.pending.lingering_until(WHO, RTU, 0.6) is None
    assert line.free(WIND, 1.0)
    assert line.waiting() == []


def test_after_broken_bytes_nothing_lingers(line: Line) -> None:
    line.silent(WIND, 0.0, FaultCode.MALFORMED)
    assert line.pending.confusable(WIND, RTU)
    line.answered(WHO, 0.3)
    assert line.free(WIND, 0.5)


def test_an_answer_to_a_barrier_may_be_that_of_the_barrier_before(line: Line) -> None:
    line.silent(WIND, 0.0)
    line.silent(WHO, 2.0)
    line.answered(WHO, 4.0)
    assert line.waiting() == [WHO]
    assert line.free(WIND, 4.2)
    line.silent(WIND, 4.2)
    line.answered(WHO, 6.0)  # of the barrier at 4.0, for all we know
    assert line.waiting() == [WIND, WHO]
    line.answered(WHO, 8.0)
    assert line.free(WIND, 8.2)
    line.answered(WIND, 8.2)
    assert line.waiting() == []


def test_another_request_of_the_same_shape_is_confusable_too(line: Line) -> None:
    line.silent(WHERE, 0.0)
    assert line.pending.confusable(WHO, RTU)
    line.answered(WHO, 2.0)
    assert line.waiting() == [WHO]


def test_a_late_answer_ends_its_request_and_those_before(line: Line) -> None:
    line.silent(WIND, 0.0, FaultCode.CRC)
    line.silent(WHERE, 0.3, FaultCode.CRC)
    line.silent(WHO, 0.6, FaultCode.LATE, WHERE)
    assert line.waiting() == [WHO]
    line.silent(OTHER, 0.9, FaultCode.TIMEOUT, WHO, WHO)
    assert line.waiting() == []
    assert line.waiting(2) == [OTHER]


def test_a_late_answer_that_came_is_not_waited_for(line: Line) -> None:
    line.silent(WIND, 0.0)
    line.answered(WHO, 0.3, WIND)
    assert line.free(WIND, 0.5)


def test_bytes_that_only_begin_as_an_answer_end_the_oldest(line: Line) -> None:
    line.begun(WIND, 0.0)
    assert line.waiting() == []
    line.silent(WIND, 0.0, FaultCode.CRC)
    line.silent(WHERE, 0.3, FaultCode.CRC)
    line.begun(WHO, 0.6)
    assert line.waiting() == [WHERE, WHO]


def test_an_ambiguous_exception_has_the_slave_left_alone_for_a_second(line: Line) -> None:
    line.silent(WIND, 0.0)
    line.refused(WHO, 0.3, ambiguous=True)
    assert line.pending.left_alone_until(1, 1.0) == 1.3
    assert line.pending.left_alone_until(2, 1.0) is None
    assert line.pending.left_alone_until(1, 1.3) is None
    assert line.waiting() == []
    assert line.free(WIND, 1.3)


def test_an_exception_that_can_only_be_ours_proves_that_nothing_is_pending(line: Line) -> None:
    line.silent(WIND, 0.0, FaultCode.CRC)
    line.refused(WHO, 0.3, ambiguous=False)
    assert line.waiting() == []


def test_a_late_answer_to_the_last_one_ends_the_rest_of_the_slave_too(line: Line) -> None:
    line.silent(WIND, 0.0, FaultCode.CRC)
    line.refused(WHO, 0.3, ambiguous=True)
    line.answered(OTHER, 0.6, WHO)
    assert line.pending.left_alone_until(1, 0.7) is None


def test_a_slave_without_barrier_is_left_alone_for_twice_its_time_out(line: Line) -> None:
    line.silent(WIND, 5.0)
    line.pending.leave_alone(1, 0.8)
    assert line.pending.left_alone_until(1, 6.0) == 6.6


def test_what_was_never_sent_and_what_nobody_answers_is_not_pending(line: Line) -> None:
    line.pending.on_outcome(replace(PLAIN, sent_end=None), RTU, 0.2, 0.2)
    everybody = replace(PLAIN, request=WriteRegister(0, 4, 1))
    line.pending.on_outcome(everybody, RTU, 0.2, 0.2)
    line.pending.abandoned(everybody.request, RTU, 0.2, 0.2)
    assert not line.pending.by_slave


def test_an_exchange_that_was_cut_off_may_still_be_answered(line: Line) -> None:
    line.pending.abandoned(WIND, RTU, 0.2, 3.0)
    assert line.pending.confusable(WIND, RTU)
    line.answered(WHO, 3.1)
    assert line.pending.lingering_until(WIND, RTU, 3.4) == 4.0


def test_of_equal_requests_the_newest_are_remembered(line: Line) -> None:
    line.silent(WIND, 0.0)
    for n in range(20):
        line.silent(WHO, 1.0 + n)
    pending = line.pending.earlier(1)
    assert [each.request for each in pending] == [WIND] + [WHO] * EQUALS_KEPT
    assert pending[-1].sent_end == 20.0


def test_answers_to_many_barriers_do_not_end_a_value_asked_after_those(line: Line) -> None:
    before, after = 4, 5
    for n in range(before):
        line.silent(WHO, 1.0 + n)
    line.silent(WIND, 10.0)
    for n in range(after):
        line.silent(WHO, 20.0 + n)
    for n in range(before):
        line.answered(WHO, 30.0 + n)
    assert line.pending.confusable(WIND, RTU)


@given(
    st.lists(st.tuples(st.sampled_from(["asks", "answers"]), st.floats(0.0, 0.4)), max_size=60),
    st.integers(0, 3),
)
def test_no_answer_of_a_slave_that_answers_in_turn_is_taken_for_another(
    steps: list[tuple[str, float]], lag: int
) -> None:
    """The slave answers up to `lag` requests late; the master believes a value only where it may."""
    line, now = Line(), 0.0
    backlog: list[tuple[Request, int]] = []
    for number, (step, pause) in enumerate(steps):
        now += EXCHANGE + pause
        request = WIND if line.free(WIND, now) else WHO
        if request is WIND or line.pending.left_alone_until(1, now) is None:
            backlog.append((request, number))
        else:
            continue
        if step == "asks" and len(backlog) <= lag:
            line.silent(request, now, FaultCode.CRC)
            continue
        late: list[Request] = []
        while backlog:
            heard, asked = backlog.pop(0)
            if heard == request:
                assert request is WHO or asked == number
                line.answered(request, now, *late)
                break
            late.append(heard)


def test_a_slave_whose_answer_came_while_another_was_asked_is_tardy() -> None:
    line = Line()
    line.silent(WIND, 0.0)
    assert 1 not in line.pending.tardy
    line.answered(OTHER, 0.3, WIND)
    assert 1 in line.pending.tardy
    assert 2 not in line.pending.tardy


@pytest.mark.parametrize("exception", [5, 10, 11])
@pytest.mark.parametrize("ambiguous", [True, False])
def test_after_an_exception_that_does_not_end_it_a_request_stays_pending(exception: int, *, ambiguous: bool) -> None:
    line = Line()
    line.silent(WHO, 0.0)
    outcome = ended(WIND, fault=Fault(FaultCode.EXCEPTION, "", exception), answered=True, ambiguous=ambiguous)
    line.pending.on_outcome(replace(outcome, sent_end=1.0), RTU, 0.2, 1.1)
    assert [each.request for each in line.pending.earlier(1)] == [WHO, WIND]
    assert line.pending.confusable(WIND, RTU)
    assert line.pending.left_alone_until(1, 1.1) is None


def test_another_masters_request_is_pending_until_its_answer_is_heard() -> None:
    line = Line()
    pending = line.pending
    assert not pending.overheard(1, 9, exception=None, now=0.0)
    pending.asked_by_another(WIND, RTU, 1.0)
    assert pending.confusable(WIND, RTU)
    assert pending.overheard(1, 7, exception=None, now=1.1)  # of another shape: something is owed, but not this
    assert pending.overheard(1, 9, exception=None, now=1.2)
    assert pending.earlier(1) == ()
    pending.asked_by_another(WIND, RTU, 2.0)
    assert pending.overheard(1, 5, exception=2, now=2.1)
    assert pending.earlier(1) == ()


@pytest.mark.parametrize("exception", [5, 10, 11])
def test_an_exception_that_does_not_end_it_leaves_another_masters_request_pending_too(exception: int) -> None:
    pending = Line().pending
    pending.asked_by_another(WIND, RTU, 1.0)
    assert pending.overheard(1, 5, exception=exception, now=1.1)
    assert [each.request for each in pending.earlier(1)] == [WIND]
    pending.on_outcome(ended(WHO, answer=(7,), answered=True, sent_end=1.2), RTU, 0.2, 1.3)
    assert pending.lingering_until(WIND, RTU, 1.3) == pytest.approx(1.1 + QUIET_LEAST)
    assert pending.lingering_until(WIND, RTU, 2.2) is None


def test_what_may_have_been_answered_by_another_stays_pending_until_a_barrier_is_answered() -> None:
    line = Line()
    pending = line.pending
    pending.unanswered(WIND, RTU, 1.0)
    assert pending.confusable(WIND, RTU)
    assert not pending.owes_besides(1, 1.0)
    assert pending.owes_besides(1, 2.0)
    pending.on_outcome(ended(WHO, answer=(7,), answered=True, sent_end=1.2), RTU, 0.2, 1.3)
    assert pending.earlier(1) == ()


def test_the_barrier_goes_first_only_in_a_poll_where_that_is_wanted() -> None:
    pending = Line().pending
    pending.barrier_first.add(1)
    assert pending.next_request(WIND, RTU, 0.0, barrier=WHO, timeout=0.2) == WIND


def test_a_request_of_ours_is_not_answered_by_what_is_overheard() -> None:
    line = Line()
    line.silent(WIND, 0.0)
    assert line.pending.overheard(1, 9, exception=None, now=0.1)
    assert [each.request for each in line.pending.earlier(1)] == [WIND]


def test_the_answer_to_another_master_that_comes_in_our_exchange_makes_nobody_tardy() -> None:
    line = Line()
    line.pending.asked_by_another(WIND, RTU, 0.0)
    outcome = ended(WHO, answer=(7,), fault=None, answered=True, late=(LateAnswer(WIND, 0.1, ours=False),))
    line.pending.on_outcome(replace(outcome, sent_end=0.1), RTU, 0.2, 0.2)
    assert line.pending.earlier(1) == ()
    assert 1 not in line.pending.tardy


def test_a_slave_that_is_answered_for_twice_is_left_alone() -> None:
    line = Line()
    line.pending.duplicates.answered(1, 1.0)
    until = line.pending.left_alone_until(1, 1.0)
    assert until is not None
    assert line.pending.left_alone_until(1, until) is None
    line.silent(WIND, 1.0)
    line.pending.leave_alone(1, 0.2)
    assert line.pending.left_alone_until(1, 1.1) == 2.0


def test_what_a_slave_was_asked_at_another_rate_is_over_once_it_was_silent() -> None:
    line = Line()
    line.pending.begin(1, 4800, 0.0)
    line.silent(WHO, 0.0)
    line.pending.begin(1, 9600, OTHER_RATE - 0.1)
    assert line.waiting() == [WHO]
    line.pending.begin(2, 9600, 5.0)
    assert line.waiting() == [WHO]
    line.pending.begin(1, 4800, 5.0)
    assert line.waiting() == [WHO]
    line.pending.begin(1, 9600, OTHER_RATE)
    assert line.waiting() == []
    assert line.free(WHO, OTHER_RATE)


def test_what_was_asked_at_a_rate_that_is_not_known_stays() -> None:
    line = Line()
    line.silent(WHO, 0.0)
    line.pending.begin(1, 9600, 5.0)
    assert line.waiting() == [WHO]
