"""A generator as a job: each step is a request, a wait or work off the line; its end is reported before it is over."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import replace
from typing import Any

import pytest

from lfs10d.line.jobs.job import Continue, Done, Hold, Requeue
from lfs10d.line.jobs.procedure import SLICE, Await, Finished, LineLostError, Procedure, ProcedureClock, Step
from lfs10d.modbus.ask import Ask
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.outcome import Outcome
from lfs10d.modbus.request import ReadRegisters
from lfs10d.reading import Purpose

RTU = Codec(Framing.RTU)
WHO = ReadRegisters(3, 5, 1)
HERE = Ask(WHO, RTU, 0.2)
THERE = Ask(WHO, RTU, 0.1, None, 19200)


def procedure(steps: Generator[Step, Any, Any], clock: ProcedureClock | None = None) -> tuple[Procedure, list[object]]:
    """Return a procedure of these steps on a line at 9600 baud, and what it awaits off the line."""
    told: list[object] = []
    return Procedure(steps, clock or ProcedureClock(), lambda _, what: told.append(what), line_rate=9600), told


def steps_of(*steps: Step, result: object = "end") -> Generator[Step, Any, Any]:
    for step in steps:  # noqa: UP028  # `yield from` would send outcomes into the tuple
        yield step
    return result


@pytest.fixture
def answer(heard: Callable[..., Outcome]) -> Outcome:
    return heard(WHO, answer=(3,))


def test_unless_told_otherwise_it_is_a_change_that_takes_a_third_of_the_line_and_no_slave_id_for_itself() -> None:
    made, _ = procedure(steps_of(HERE))
    assert (made.purpose, made.share, made.excludes) == (Purpose.CHANGE, 0.3, frozenset())


def test_it_is_what_it_is_told_to_be() -> None:
    made = Procedure(
        steps_of(HERE),
        ProcedureClock(),
        lambda _, __: None,
        line_rate=9600,
        excludes=frozenset({3}),
        share=0.1,
        purpose=Purpose.PROBE,
    )
    assert (made.purpose, made.share, made.excludes) == (Purpose.PROBE, 0.1, frozenset({3}))


def test_a_request_is_sent_again_until_its_outcome_came_and_the_outcome_reaches_the_procedure(answer: Outcome) -> None:
    sent: list[object] = []
    times: list[float] = []
    clock = ProcedureClock()

    def steps() -> Generator[Step, Any, None]:
        sent.append((yield HERE))
        times.append(clock.now)
        yield Hold(9.0)
        times.append(clock.now)

    made, _ = procedure(steps(), clock)
    assert made.ask(1.0) == made.ask(2.0) == HERE
    assert made.on_outcome(answer, 3.0) == Requeue(3.0)
    assert sent == [answer]
    assert made.ask(3.5) == Hold(9.0)
    made.ask(9.0)
    assert times == [3.0, 9.0]


def test_a_hold_ends_at_its_time_and_not_before() -> None:
    made, _ = procedure(steps_of(Hold(5.0), HERE))
    assert made.ask(1.0) == Hold(5.0)
    assert made.ask(4.9) == Hold(5.0)
    assert made.ask(5.0) == HERE


def test_a_hold_without_end_is_passed_on() -> None:
    made, _ = procedure(steps_of(Hold(), HERE))
    assert made.ask(1.0) == Hold()


def test_work_off_the_line_is_reported_once_and_the_procedure_goes_on_with_its_result() -> None:
    sent: list[object] = []

    def steps() -> Generator[Step, Any, None]:
        sent.append((yield Await("intent")))
        sent.append((yield Await("second")))
        yield HERE

    made, told = procedure(steps())
    assert made.ask(1.0) == made.ask(2.0) == Hold()
    assert told == ["intent"]
    made.resume("on the disk")
    assert made.ask(3.0) == Hold()
    assert told == ["intent", "second"]
    made.resume()
    assert made.ask(4.0) == HERE
    assert sent == ["on the disk", None]


def test_what_is_answered_at_once_is_not_waited_for() -> None:
    told: list[object] = []

    def at_once(made: Procedure, what: object) -> None:
        told.append(what)
        made.resume()

    made = Procedure(steps_of(Await("intent"), HERE), ProcedureClock(), at_once, line_rate=9600)
    assert made.ask(1.0) == HERE
    assert told == ["intent"]


def test_it_is_over_only_when_its_end_was_taken_care_of(answer: Outcome) -> None:
    made, told = procedure(steps_of(HERE, result="moved"))
    made.ask(1.0)
    assert made.on_outcome(answer, 1.1) == Requeue(1.1)
    assert made.ask(1.2) == made.ask(1.3) == Hold()
    assert told == [Finished("moved")]
    made.resume()
    assert made.ask(1.4) == Done()
    assert made.on_outcome(answer, 1.5) == Done()
    assert told == [Finished("moved")]


def test_at_another_rate_it_goes_on_at_once_for_a_quarter_of_a_second(answer: Outcome) -> None:
    made, _ = procedure(steps_of(*[THERE] * 9))
    made.ask(1.0)
    assert made.on_outcome(answer, 1.05) == Continue()
    made.ask(1.05)
    assert made.on_outcome(answer, 1.0 + SLICE - THERE.timeout) == Continue()
    made.ask(1.15)
    assert made.on_outcome(answer, 1.151) == Requeue(1.151)
    made.ask(1.4)
    assert made.on_outcome(answer, 1.4 + SLICE - THERE.timeout) == Continue()


@pytest.mark.parametrize("following", [HERE, Ask(WHO, RTU, 0.1, None, 4800), Hold(2.0)])
def test_a_stay_at_another_rate_ends_where_what_follows_does_not_belong_there(answer: Outcome, following: Step) -> None:
    made, _ = procedure(steps_of(THERE, following))
    made.ask(1.0)
    assert made.on_outcome(answer, 1.01) == Requeue(1.01)


@pytest.mark.parametrize("rate", [None, 9600])
def test_at_the_lines_own_rate_others_may_have_the_line_between_two_questions(
    answer: Outcome, rate: int | None
) -> None:
    own = Ask(WHO, RTU, 0.1, None, rate)
    made, _ = procedure(steps_of(own, own))
    made.ask(1.0)
    assert made.on_outcome(answer, 1.01) == Requeue(1.01)


def test_halted_it_sends_nothing_and_tells_nothing(answer: Outcome) -> None:
    made, told = procedure(steps_of(HERE, HERE))
    made.ask(1.0)
    made.halt()
    assert made.on_outcome(answer, 1.1) == Done()
    assert made.ask(1.2) == Done()
    made.cut_off(1.3)
    assert told == []


def test_an_outcome_it_did_not_ask_for_ends_it_without_harm(answer: Outcome) -> None:
    made, _ = procedure(steps_of(Hold(5.0), HERE))
    made.ask(1.0)
    assert made.on_outcome(answer, 1.1) == Done()


@pytest.mark.parametrize("begun", [False, True])
def test_where_the_port_is_lost_the_procedure_says_what_that_means(begun: bool) -> None:  # noqa: FBT001  # a case
    clock = ProcedureClock()

    def steps() -> Generator[Step, Any, object]:
        try:
            yield HERE
        except LineLostError:
            return f"lost at {clock.now}"
        return "never"

    made, told = procedure(steps(), clock)
    if begun:
        made.ask(1.0)
    made.cut_off(2.0)
    made.cut_off(3.0)
    assert told == [Finished("lost at 2.0")]
    assert made.ask(4.0) == Done()


def test_a_procedure_that_ignores_the_loss_of_the_port_is_over_without_a_result() -> None:
    made, told = procedure(steps_of(HERE))
    made.ask(1.0)
    made.cut_off(2.0)
    assert told == [Finished(None)]


def test_a_port_lost_after_the_end_changes_nothing_about_it(answer: Outcome) -> None:
    made, told = procedure(steps_of(HERE, result="moved"))
    made.ask(1.0)
    made.on_outcome(answer, 1.1)
    made.cut_off(1.2)
    assert made.ask(1.3) == Hold()
    assert told == [Finished("moved")]


def test_a_question_that_belongs_behind_the_one_before_it_is_asked_at_once(answer: Outcome) -> None:
    made, _ = procedure(steps_of(HERE, replace(HERE, at_once=True), HERE))
    assert made.ask(1.0) == HERE
    assert made.on_outcome(answer, 1.1) == Continue()
    assert made.ask(1.1) == replace(HERE, at_once=True)
    assert made.on_outcome(answer, 1.2) == Requeue(1.2)
