"""Repeats of a request: the first response again, and for how long."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.command import Command, failed, ok
from lfs10d.commands.admission import (
    RATE,
    REMEMBERED,
    REMEMBERED_FOR,
    WAITING,
    Admitted,
    Answered,
    Waiting,
)
from lfs10d.commands.message import LARGEST_CORRELATION
from tests.support.admissions import DAY, NOW, Door

# Repeats


def test_a_repeat_gets_the_first_answer_and_its_time_again() -> None:
    door = Door()
    admitted = door.admitted("device/read", {"id": "a", "to": 1})
    door.now += 0.25
    answer = ok({"from": 1})
    assert door.done(admitted, answer) == []
    door.now += 10
    again = door.answered("device/read", {"to": 1, "id": "a"})
    assert (again.result, again.took, again.command.id, again.clear) == (answer, 0.25, "a", False)


def test_repeats_wait_while_the_first_runs_and_are_all_given_back_once() -> None:
    door = Door()
    admitted = door.admitted("device/read", {"id": "a", "to": 1})
    assert door.tell("device/read", {"id": "a", "to": 1}, reply_to="one") == Waiting()
    assert door.tell("device/read", {"transaction": "a", "to": 1}, reply_to="two") == Waiting()
    assert door.done(admitted) == [("a", "one"), (None, "two")]
    assert isinstance(door.tell("device/read", {"id": "a", "to": 1}), Answered)


def test_of_the_repeats_of_one_request_16_wait_and_more_are_busy() -> None:
    door = Door()
    admitted = door.admitted("device/read", {"id": "a", "to": 1})
    for number in range(WAITING):
        assert door.tell("device/read", {"id": "a", "to": 1}, reply_to=str(number)) == Waiting()
    assert door.code("device/read", {"id": "a", "to": 1}) == "busy"
    other = door.admitted("device/read", {"id": "b", "to": 1})
    assert door.tell("device/read", {"id": "b", "to": 1}) == Waiting(), "those of another request are its own"
    assert [reply_to for _, reply_to in door.done(admitted)] == [str(number) for number in range(WAITING)]
    assert len(door.done(other)) == 1
    assert door.answered("device/read", {"id": "a", "to": 1}).result == ok()


def test_correlation_data_may_have_1024_bytes_and_no_more_whatever_the_payload() -> None:
    door = Door()
    for name in ("device/read", "no/request"):
        decision = door.admission.admit(
            name,
            b'{"id": "a", "to": 1}',
            retained=False,
            reply_to="here",
            now=NOW,
            correlation=LARGEST_CORRELATION + 1,
        )
        assert isinstance(decision, Answered)
        assert (decision.command.id, decision.result.status, decision.result.code) == ("a", "rejected", "too_large")
    allowed = door.admission.admit(
        "device/read",
        b'{"id": "a", "to": 1}',
        retained=False,
        reply_to="here",
        now=NOW,
        correlation=LARGEST_CORRELATION,
    )
    assert isinstance(allowed, Admitted), "and what was too large was not remembered"


def test_a_repeat_with_other_parameters_is_a_conflict_while_the_first_runs_and_afterwards() -> None:
    door = Door()
    admitted = door.admitted("device/read", {"id": "a", "to": 1})
    assert door.code("device/read", {"id": "a", "to": 2}) == "duplicate_conflict"
    door.done(admitted)
    assert door.code("device/read", {"id": "a", "to": 2}) == "duplicate_conflict"
    assert door.code("device/read", {"id": "a"}) == "duplicate_conflict"
    assert isinstance(door.tell("device/read", {"id": "a", "to": 1}), Answered)


def test_an_id_is_one_per_request_and_text_is_no_number() -> None:
    door = Door()
    door.done(door.admitted("device/read", {"id": 1, "to": 1}))
    assert isinstance(door.tell("device/read", {"id": "1", "to": 2}), Admitted)
    assert isinstance(door.tell("device/readdress", {"id": 1, "to": 2}), Admitted)
    assert isinstance(door.tell("health", {"id": 1}), Admitted)


def test_requests_without_an_id_are_never_repeats() -> None:
    door = Door()
    for _ in range(5):
        door.done(door.admitted("device/read", {"to": 1}))


def test_a_rejected_parameter_is_remembered_with_its_id() -> None:
    door = Door()
    first = door.answered("device/read", {"id": "a", "to": 0})
    assert first.result.code == "invalid_param"
    assert door.answered("device/read", {"id": "a", "to": 0}).result is first.result
    assert door.code("device/read", {"id": "a", "to": 1}) == "duplicate_conflict"


@pytest.mark.parametrize(("name", "kept"), [("device/read", REMEMBERED_FOR), ("device/readdress", DAY)])
def test_an_answer_is_remembered_from_the_response_on_for_as_long_as_its_form_says(name: str, kept: float) -> None:
    door = Door()
    admitted = door.admitted(name, {"id": "a", "to": 1})
    door.now += 1e6  # however long it takes
    door.done(admitted)
    door.now += kept - 0.001
    assert isinstance(door.tell(name, {"id": "a", "to": 1}), Answered)
    door.now += 0.001
    assert isinstance(door.tell(name, {"id": "a", "to": 2}), Admitted)


def fill(door: Door, count: int, first: int = 0) -> None:
    """Let `count` requests with ids of their own come and go, as fast as the rate allows."""
    for number in range(first, first + count):
        door.now += 1 / RATE + 1e-9
        door.done(door.admitted("health", {"id": number}))


def test_256_ids_are_remembered_and_the_oldest_goes_first() -> None:
    door = Door()
    fill(door, REMEMBERED)
    assert isinstance(door.tell("health", {"id": 0}), Answered)
    fill(door, 1, REMEMBERED)
    assert isinstance(door.tell("health", {"id": 1}), Answered)
    assert isinstance(door.tell("health", {"id": 0}), Admitted)


def test_a_flood_of_ids_pushes_out_neither_a_physical_change_nor_what_still_runs() -> None:
    door = Door()
    door.done(door.admitted("device/readdress", {"id": "moved", "to": 9}))
    running = door.admitted("device/read", {"id": "running", "to": 1})
    fill(door, 3 * REMEMBERED)
    assert isinstance(door.tell("device/readdress", {"id": "moved", "to": 9}), Answered)
    assert isinstance(door.tell("device/read", {"id": "running", "to": 1}), Waiting)
    assert door.done(running, failed("timeout", "")) == [("running", "here")]


def test_many_that_ran_at_once_are_forgotten_down_to_256() -> None:
    door = Door()
    all_admitted = []
    for number in range(REMEMBERED + 50):
        door.now += 1 / RATE + 1e-9
        all_admitted.append(door.admitted("health", {"id": number}))
    for admitted in all_admitted:
        door.done(admitted)
    fill(door, 1, 1000)
    known = [isinstance(door.tell("health", {"id": number}), Answered) for number in (53, 52, 51, 50)]
    assert known == [True, True, True, False]


STEPS = st.lists(
    st.tuples(st.integers(0, 3), st.integers(1, 2), st.booleans(), st.floats(0, 90, allow_nan=False)), max_size=40
)


@given(STEPS)
def test_every_request_is_given_back_exactly_once_and_no_id_is_performed_twice_within_a_minute(
    steps: list[tuple[int, int, bool, float]],
) -> None:
    """The law of the door: each request comes back by a decision or by `done`, never by both."""
    door = Door()
    running: list[Admitted[str]] = []
    owed = 0
    given = 0
    performed: dict[int, float] = {}
    for key, to, finish, pause in steps:
        door.now += pause
        owed += 1
        decision = door.tell("device/read", {"id": key, "to": to})
        if isinstance(decision, Answered):
            given += 1
        elif isinstance(decision, Admitted):
            assert key not in performed or door.now >= performed[key] + REMEMBERED_FOR
            assert all(admitted.command.id != key for admitted in running)
            running.append(decision)
        if finish and running:
            admitted = running.pop(0)
            given += 1 + len(door.done(admitted))
            assert isinstance(admitted.command.id, int)
            performed[admitted.command.id] = door.now
    given += sum(1 + len(door.done(admitted)) for admitted in running)
    assert given == owed


def test_a_request_of_an_earlier_life_is_not_carried_out_again_and_its_repeats_wait_for_its_answer() -> None:
    door = Door()
    call = Command("a1", fingerprint=json.dumps({"to": 9}))
    assert door.admission.recall("device/readdress", call, None, NOW + DAY) == []
    waiting = door.tell("device/readdress", {"id": "a1", "to": 9}, reply_to="again")
    assert isinstance(waiting, Waiting)
    ((repeat, reply_to),) = door.admission.recall("device/readdress", call, ok({"to": 9}), NOW + DAY)
    assert (repeat.id, reply_to) == ("a1", "again")
    answered = door.tell("device/readdress", {"id": "a1", "to": 9})
    assert isinstance(answered, Answered)
    assert answered.result == ok({"to": 9})


def test_a_request_of_an_earlier_life_without_an_id_cannot_be_repeated() -> None:
    assert Door().admission.recall("device/readdress", Command(None), ok({}), NOW + DAY) == []
