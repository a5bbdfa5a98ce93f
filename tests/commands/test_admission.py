"""Admission: which requests are obeyed, in the order of the checks, and what becomes of repeats."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.commands.admission import (
    BURST,
    RATE,
    Admitted,
)
from lfs10d.commands.message import LARGEST
from tests.support.admissions import FORMS, NOW, Door, To


def test_a_request_of_an_allowed_class_is_admitted_with_its_parameters() -> None:
    admitted = Door().admitted("device/read", {"id": "a", "to": 9})
    assert (admitted.name, admitted.command.id, admitted.parameters, admitted.since) == (
        "device/read",
        "a",
        To(to=9),
        NOW,
    )


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
    door.admitted("device/read", {"id": "used", "to": 1})
    if flooded:
        door.flood()
    decision = door.answered(name, payload, retained=retained)
    assert (decision.result.code, decision.clear) == (code, code == "retained")


@pytest.mark.parametrize("retained", [True, False])
def test_an_empty_payload_is_ignored_and_costs_nothing(retained: bool) -> None:  # noqa: FBT001 - one claim for both
    door = Door()
    for _ in range(2 * BURST):
        assert door.tell("no/request", b"", retained=retained) is None
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
