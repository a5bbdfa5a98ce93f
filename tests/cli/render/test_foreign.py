"""What any client may have published, and what is believed of it."""

from __future__ import annotations

from math import inf, nan

import pytest

from lfs10d.cli.render.foreign import mapping, named, number


def test_what_is_no_object_is_an_empty_one() -> None:
    assert mapping({"a": 1}) == {"a": 1}
    others: list[object] = [None, [], "a", 1]
    assert [mapping(value) for value in others] == [{}, {}, {}, {}]


def test_of_a_list_the_objects_with_a_name_are_taken() -> None:
    entries = [{"name": "a", "id": 2}, {"name": 3}, {}, "b", None, {"name": "c"}]
    assert list(named(entries)) == [("a", {"name": "a", "id": 2}), ("c", {"name": "c"})]
    assert list(named({"name": "a"})) == []


@pytest.mark.parametrize("value", [0, 3, -1.5, 2**60])
def test_a_finite_number_stays_as_it_is(value: float) -> None:
    assert number(value) == value
    assert type(number(value)) is type(value)


@pytest.mark.parametrize("value", [None, True, "3", [], nan, inf, 10**400])
def test_all_else_is_no_number(value: object) -> None:
    assert number(value) is None
