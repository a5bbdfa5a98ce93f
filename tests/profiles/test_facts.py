"""The words and numbers in which the facts of a profile are written."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from lfs10d.profiles.facts import Address, Factor, Facts, Range, Registered, Word, refuse
from lfs10d.schema.fields import FieldError


def test_a_word_is_a_name_in_snake_case_that_is_not_reserved() -> None:
    kind = Word(frozenset({"seq"}))
    assert kind.accept("wind_speed") == "wind_speed"
    for wrong in ("Wind", "2m", "", 7):
        with pytest.raises(FieldError, match="must be a name of 1 to 48"):
            kind.accept(wrong)
    with pytest.raises(FieldError, match="is a key of every sample already; choose another, such as raw_seq"):
        kind.accept("seq")


@pytest.mark.parametrize("number", [1, -0.1, 1e-12, 1e12])
def test_a_factor_is_any_number_that_keeps_results_finite(number: float) -> None:
    assert Factor().accept(number) == number


@pytest.mark.parametrize("number", [0, 1e-13, -2e12, True, "1", None])
def test_another_factor_is_refused(number: object) -> None:
    with pytest.raises(FieldError, match=r"must be a number from 1e-12 to 1e12, or its negative"):
        Factor().accept(number)


@pytest.mark.parametrize(
    ("value", "why"),
    [
        (70000, "must be a whole number from 0 to 65535, not 70000"),
        ("1", 'must be a whole number from 0 to 65535, not text "1"'),
        (
            400010,
            (
                "must be a whole number from 0 to 65535; 400010 looks like a number of the manual: 4 stands for "
                "holding register there, and the rest counts from one, so write 9"
            ),
        ),
    ],
)
def test_an_address_that_is_none_is_refused_and_a_number_of_the_manual_explained(value: object, why: str) -> None:
    with pytest.raises(FieldError) as caught:
        Address(0, 0xFFFF).accept(value)
    assert str(caught.value) == why


class Bounded(Facts):
    """Something with a range."""

    range: Range


def test_a_range_goes_up() -> None:
    assert Bounded.model_validate({"range": [0, 1]}).range == (0, 1)
    with pytest.raises(ValidationError, match="the first number of a range must be less than the second"):
        Bounded.model_validate({"range": [1, 1]})


@pytest.mark.parametrize(("given", "shown"), [([], "an empty list"), ([1], "a list"), (7, "7")])
def test_a_range_is_a_list_of_two(given: object, shown: str) -> None:
    with pytest.raises(ValidationError) as caught:
        Bounded.model_validate({"range": given})
    (wrong,) = caught.value.errors()
    assert wrong["loc"] == ("range",)
    assert wrong["msg"] == f"must be the least and the greatest number, such as [0, 60], not {shown}"


def test_each_problem_is_refused_at_its_own_place() -> None:
    refuse([])
    with pytest.raises(ValidationError) as caught:
        refuse([(("a", 0), "is {odd}"), ((), "is wrong")])
    found: list[tuple[tuple[Any, ...], str]] = [(wrong["loc"], wrong["msg"]) for wrong in caught.value.errors()]
    assert found == [(("a", 0), "is {odd}"), ((), "is wrong")]


def test_the_register_of_a_fact_is_its_address_on_the_wire() -> None:
    assert Registered.model_validate({"register": 0x0162}).register == 0x0162
