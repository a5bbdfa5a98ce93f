"""Admission: which requests are obeyed, in the order of the checks, and what becomes of repeats."""

from __future__ import annotations

import json
from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.command import Command, Result, failed, ok
from lfs10d.commands.admission import (
    BURST,
    RATE,
    REMEMBERED,
    REMEMBERED_FOR,
    WAITING,
    Admission,
    Admitted,
    Answered,
    CommandSpec,
    Ignored,
    Waiting,
)
from lfs10d.commands.message import LARGEST, LARGEST_CORRELATION, Parameters
from lfs10d.schema.fields import Whole

NOW = 1000.0
DAY = 86_400.0


class To(Parameters):
    """The parameters of the one request that has any."""

    to: Annotated[int, Whole(1, 255)]


FORMS = {
    "health": CommandSpec("always"),
    "device/read": CommandSpec("polling", To),
    "device/readdress": CommandSpec("sensors", To, remembered_for=DAY),
    "register/read": CommandSpec("registers"),
}


class Door:
    """An admission with a clock: `tell` is one request at the present `now`."""

    def __init__(self, *allowed: str) -> None:
        self.admission = Admission[str](FORMS, frozenset(allowed or ("polling", "sensors")))
        self.now = NOW

    def tell(
        self, name: str, content: object = None, *, retained: bool = False, reply_to: str = "here"
    ) -> Ignored | Answered | Admitted[str] | Waiting:
        payload = content if isinstance(content, bytes) else json.dumps({} if content is None else content).encode()
        return self.admission.admit(name, payload, retained=retained, reply_to=reply_to, now=self.now)

    def ticket(self, name: str, content: object = None) -> Admitted[str]:
        verdict = self.tell(name, content)
        assert isinstance(verdict, Admitted)
        return verdict

    def answered(self, name: str, content: object = None, *, retained: bool = False) -> Answered:
        verdict = self.tell(name, content, retained=retained)
        assert isinstance(verdict, Answered)
        return verdict

    def code(self, name: str, content: object = None, *, retained: bool = False) -> str | None:
        verdict = self.answered(name, content, retained=retained)
        assert verdict.result.status == "rejected"
        return verdict.result.code

    def done(self, ticket: Admitted[str], answer: Result | None = None) -> list[tuple[object, str]]:
        return [(call.id, reply_to) for call, reply_to in self.admission.done(ticket, answer or ok(), self.now)]

    def flood(self) -> None:
        """Use up the burst."""
        for _ in range(BURST):
            self.tell("health", {})


def test_a_request_of_an_allowed_class_gets_a_ticket_with_its_parameters() -> None:
    ticket = Door().ticket("device/read", {"id": "a", "to": 9})
    assert (ticket.name, ticket.command.id, ticket.parameters, ticket.since) == ("device/read", "a", To(to=9), NOW)


# Each check before the next: a request that is wrong in every way from here on is told the first.

WRONG_FROM_HERE_ON = [
    ("retained", b"[" * (LARGEST + 1), "no/request", True, True),
    ("too_large", b"[" * (LARGEST + 1), "no/request", False, True),
    ("rate_limited", b"[", "no/request", False, True),
    ("invalid_json", b"[", "no/request", False, False),
    ("unknown_request", b'{"id":[],"to":0}', "no/request", False, False),
    ("not_allowed", b'{"id":[],"to":0}', "register/read", False, False),
    ("duplicate_conflict", b'{"id":"used","to":0}', "device/read", False, False),
    ("invalid_param", b'{"id":[],"to":0}', "device/read", False, False),
    ("invalid_param", b'{"id":"new","to":0}', "device/read", False, False),
]


@pytest.mark.parametrize(("code", "payload", "name", "retained", "flooded"), WRONG_FROM_HERE_ON)
def test_the_checks_come_in_the_order_of_the_contract(
    code: str, payload: bytes, name: str, retained: bool, flooded: bool  # noqa: FBT001 - columns of a table
) -> None:  # fmt: skip
    door = Door()
    door.ticket("device/read", {"id": "used", "to": 1})
    if flooded:
        door.flood()
    verdict = door.answered(name, payload, retained=retained)
    assert (verdict.result.code, verdict.clear) == (code, code == "retained")


@pytest.mark.parametrize("retained", [True, False])
def test_an_empty_payload_is_ignored_and_costs_nothing(retained: bool) -> None:  # noqa: FBT001 - one claim for both
    door = Door()
    for _ in range(2 * BURST):
        assert door.tell("no/request", b"", retained=retained) == Ignored()
    assert isinstance(door.tell("health", {}), Admitted)


def test_a_retained_request_is_told_by_its_id_if_it_can_be_read() -> None:
    door = Door()
    assert door.answered("health", {"id": "a"}, retained=True).command.id == "a"
    assert door.answered("health", b"{", retained=True).command.id is None
    assert door.answered("health", b'{"id":"a",' + b" " * LARGEST + b"}", retained=True).command.id is None


@pytest.mark.parametrize(("content", "retained"), [({}, True), (b" " * (LARGEST + 1), False)])
def test_retained_and_oversize_requests_count_towards_the_rate_and_keep_their_code(
    content: object, retained: bool  # noqa: FBT001 - a column of the table
) -> None:  # fmt: skip
    door = Door()
    told = [door.answered("health", content, retained=retained) for _ in range(BURST + 2)]
    assert {each.result.code for each in told} == {"retained" if retained else "too_large"}
    assert [each.flood for each in told] == [*[False] * BURST, True, True]
    assert door.code("health", {}) == "rate_limited"


def test_a_payload_may_have_4096_bytes_and_no_more() -> None:
    fitting = b'{"id":"a"' + b" " * (LARGEST - 10) + b"}"
    assert len(fitting) == 4096
    assert isinstance(Door().tell("health", fitting), Admitted)
    assert Door().code("health", fitting + b" ") == "too_large"


def test_an_id_of_another_kind_is_rejected_after_class_and_name() -> None:
    door = Door()
    assert door.code("no/request", {"id": True}) == "unknown_request"
    assert door.code("register/read", {"id": True}) == "not_allowed"
    assert door.code("health", {"id": True}) == "invalid_param"


@pytest.mark.parametrize("name", ["", "/", "health/", "/health", "device", "device/read/x", "DEVICE/READ", "config"])
def test_only_exact_names_are_known(name: str) -> None:
    assert Door().code(name) == "unknown_request"


def test_with_no_class_allowed_only_what_is_always_allowed_is_obeyed() -> None:
    door = Door("none")
    assert isinstance(door.tell("health"), Admitted)
    assert [door.code(name) for name in FORMS if name != "health"] == ["not_allowed"] * 3


def test_a_class_allowed_later_is_obeyed_from_then_on_even_for_an_id_refused_before() -> None:
    door = Door()
    assert door.code("register/read", {"id": "a"}) == "not_allowed"
    door.admission.allowed = frozenset({"registers"})
    assert isinstance(door.tell("register/read", {"id": "a"}), Admitted)
    assert door.code("device/read", {"to": 1}) == "not_allowed"


# The rate


def test_a_burst_of_64_is_obeyed_and_the_65th_is_not() -> None:
    door = Door()
    door.flood()
    assert door.code("health", {"id": "late"}) == "rate_limited"
    assert door.answered("health", {"id": "late"}).command.id == "late"


def test_a_rate_limited_id_is_obeyed_when_it_is_sent_again() -> None:
    door = Door()
    door.flood()
    assert door.code("health", {"id": "a"}) == "rate_limited"
    door.now += 1 / RATE + 1e-9
    assert isinstance(door.tell("health", {"id": "a"}), Admitted)


@given(st.lists(st.floats(0, 10, allow_nan=False), min_size=1, max_size=300))
def test_in_any_span_at_most_the_burst_and_20_a_second_are_obeyed(pauses: list[float]) -> None:
    door = Door()
    obeyed: list[float] = []
    for pause in pauses:
        door.now += pause / 100
        if isinstance(door.tell("health", {}), Admitted):
            obeyed.append(door.now)
    for first in range(len(obeyed)):
        assert len(obeyed) - first <= BURST + (obeyed[-1] - obeyed[first]) * RATE + 1e-6


def test_20_a_second_are_obeyed_for_ever() -> None:
    door = Door()
    door.flood()
    for _ in range(1000):
        door.now += 1 / RATE + 1e-9
        assert isinstance(door.tell("health", {}), Admitted)


# Repeats


def test_a_repeat_gets_the_first_answer_and_its_time_again() -> None:
    door = Door()
    ticket = door.ticket("device/read", {"id": "a", "to": 1})
    door.now += 0.25
    answer = ok({"from": 1})
    assert door.done(ticket, answer) == []
    door.now += 10
    again = door.answered("device/read", {"to": 1, "id": "a"})
    assert (again.result, again.took, again.command.id, again.clear) == (answer, 0.25, "a", False)


def test_repeats_wait_while_the_first_runs_and_are_all_given_back_once() -> None:
    door = Door()
    ticket = door.ticket("device/read", {"id": "a", "to": 1})
    assert door.tell("device/read", {"id": "a", "to": 1}, reply_to="one") == Waiting()
    assert door.tell("device/read", {"transaction": "a", "to": 1}, reply_to="two") == Waiting()
    assert door.done(ticket) == [("a", "one"), (None, "two")]
    assert isinstance(door.tell("device/read", {"id": "a", "to": 1}), Answered)


def test_of_the_repeats_of_one_request_16_wait_and_more_are_busy() -> None:
    door = Door()
    ticket = door.ticket("device/read", {"id": "a", "to": 1})
    for number in range(WAITING):
        assert door.tell("device/read", {"id": "a", "to": 1}, reply_to=str(number)) == Waiting()
    assert door.code("device/read", {"id": "a", "to": 1}) == "busy"
    other = door.ticket("device/read", {"id": "b", "to": 1})
    assert door.tell("device/read", {"id": "b", "to": 1}) == Waiting(), "those of another request are its own"
    assert [reply_to for _, reply_to in door.done(ticket)] == [str(number) for number in range(WAITING)]
    assert len(door.done(other)) == 1
    assert door.answered("device/read", {"id": "a", "to": 1}).result == ok()


def test_correlation_data_may_have_1024_bytes_and_no_more_whatever_the_payload() -> None:
    door = Door()
    for name in ("device/read", "no/request"):
        verdict = door.admission.admit(
            name,
            b'{"id": "a", "to": 1}',
            retained=False,
            reply_to="here",
            now=NOW,
            correlation=LARGEST_CORRELATION + 1,
        )
        assert isinstance(verdict, Answered)
        assert (verdict.command.id, verdict.result.status, verdict.result.code) == ("a", "rejected", "too_large")
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
    ticket = door.ticket("device/read", {"id": "a", "to": 1})
    assert door.code("device/read", {"id": "a", "to": 2}) == "duplicate_conflict"
    door.done(ticket)
    assert door.code("device/read", {"id": "a", "to": 2}) == "duplicate_conflict"
    assert door.code("device/read", {"id": "a"}) == "duplicate_conflict"
    assert isinstance(door.tell("device/read", {"id": "a", "to": 1}), Answered)


def test_an_id_is_one_per_request_and_text_is_no_number() -> None:
    door = Door()
    door.done(door.ticket("device/read", {"id": 1, "to": 1}))
    assert isinstance(door.tell("device/read", {"id": "1", "to": 2}), Admitted)
    assert isinstance(door.tell("device/readdress", {"id": 1, "to": 2}), Admitted)
    assert isinstance(door.tell("health", {"id": 1}), Admitted)


def test_requests_without_an_id_are_never_repeats() -> None:
    door = Door()
    for _ in range(5):
        door.done(door.ticket("device/read", {"to": 1}))


def test_a_rejected_parameter_is_remembered_with_its_id() -> None:
    door = Door()
    first = door.answered("device/read", {"id": "a", "to": 0})
    assert first.result.code == "invalid_param"
    assert door.answered("device/read", {"id": "a", "to": 0}).result is first.result
    assert door.code("device/read", {"id": "a", "to": 1}) == "duplicate_conflict"


@pytest.mark.parametrize(("name", "kept"), [("device/read", REMEMBERED_FOR), ("device/readdress", DAY)])
def test_an_answer_is_remembered_from_the_response_on_for_as_long_as_its_form_says(name: str, kept: float) -> None:
    door = Door()
    ticket = door.ticket(name, {"id": "a", "to": 1})
    door.now += 1e6  # however long it takes
    door.done(ticket)
    door.now += kept - 0.001
    assert isinstance(door.tell(name, {"id": "a", "to": 1}), Answered)
    door.now += 0.001
    assert isinstance(door.tell(name, {"id": "a", "to": 2}), Admitted)


def fill(door: Door, count: int, first: int = 0) -> None:
    """Let `count` requests with ids of their own come and go, as fast as the rate allows."""
    for number in range(first, first + count):
        door.now += 1 / RATE + 1e-9
        door.done(door.ticket("health", {"id": number}))


def test_256_ids_are_remembered_and_the_oldest_goes_first() -> None:
    door = Door()
    fill(door, REMEMBERED)
    assert isinstance(door.tell("health", {"id": 0}), Answered)
    fill(door, 1, REMEMBERED)
    assert isinstance(door.tell("health", {"id": 1}), Answered)
    assert isinstance(door.tell("health", {"id": 0}), Admitted)


def test_a_flood_of_ids_pushes_out_neither_a_physical_change_nor_what_still_runs() -> None:
    door = Door()
    door.done(door.ticket("device/readdress", {"id": "moved", "to": 9}))
    running = door.ticket("device/read", {"id": "running", "to": 1})
    fill(door, 3 * REMEMBERED)
    assert isinstance(door.tell("device/readdress", {"id": "moved", "to": 9}), Answered)
    assert isinstance(door.tell("device/read", {"id": "running", "to": 1}), Waiting)
    assert door.done(running, failed("timeout", "")) == [("running", "here")]


def test_many_that_ran_at_once_are_forgotten_down_to_256() -> None:
    door = Door()
    tickets = []
    for number in range(REMEMBERED + 50):
        door.now += 1 / RATE + 1e-9
        tickets.append(door.ticket("health", {"id": number}))
    for ticket in tickets:
        door.done(ticket)
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
    """The law of the door: each request comes back by a verdict or by `done`, never by both."""
    door = Door()
    running: list[Admitted[str]] = []
    owed = 0
    given = 0
    performed: dict[int, float] = {}
    for key, to, finish, pause in steps:
        door.now += pause
        owed += 1
        verdict = door.tell("device/read", {"id": key, "to": to})
        if isinstance(verdict, Answered):
            given += 1
        elif isinstance(verdict, Admitted):
            assert key not in performed or door.now >= performed[key] + REMEMBERED_FOR
            assert all(ticket.command.id != key for ticket in running)
            running.append(verdict)
        if finish and running:
            ticket = running.pop(0)
            given += 1 + len(door.done(ticket))
            assert isinstance(ticket.command.id, int)
            performed[ticket.command.id] = door.now
    given += sum(1 + len(door.done(ticket)) for ticket in running)
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
