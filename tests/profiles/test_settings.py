"""Settings: what is accepted, and what may be written."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from lfs10d.profiles.settings import Setting
from lfs10d.profiles.values import Value

VALUE = {"name": "level", "register": 1, "type": "uint16", "unit": "m"}
SETTING = {"name": "average", "register": 16}


def problems(model: type[Value | Setting], data: dict[str, Any]) -> list[tuple[tuple[int | str, ...], str]]:
    with pytest.raises(ValidationError) as caught:
        model.model_validate(data)
    return [(wrong["loc"], wrong["msg"]) for wrong in caught.value.errors()]


@pytest.mark.parametrize("bounds", [[2, 1], [1, 1]])
def test_a_range_is_ordered(bounds: list[int]) -> None:
    wanted = "the first number of a range must be less than the second"
    assert problems(Value, VALUE | {"range": bounds}) == [(("range",), wanted)]
    assert problems(Setting, SETTING | {"range": bounds}) == [(("range",), wanted)]


def test_a_setting_not_marked_writable_is_never_written() -> None:
    setting = Setting.model_validate(SETTING | {"range": [0, 10]})
    assert setting.refusal(5) == "average is not marked writable by the profile"


def test_a_writable_setting_is_bounded() -> None:
    wanted = "a setting is writable only with a range or values"
    assert problems(Setting, SETTING | {"writable": True}) == [(("writable",), wanted)]


def test_a_range_with_a_problem_is_the_only_problem_of_a_writable_setting() -> None:
    wrong = problems(Setting, SETTING | {"writable": True, "range": [2, 1]})
    assert [place for place, _ in wrong] == [("range",)]


@given(word=st.integers(0, 0xFFFF))
def test_a_setting_takes_what_lies_in_its_range_in_its_unit(word: int) -> None:
    more = {"type": "int16", "scale": 0.1, "unit": "s", "range": [-10, 60], "writable": True}
    setting = Setting.model_validate(SETTING | more)
    signed = int.from_bytes(word.to_bytes(2, "big"), "big", signed=True)
    assert (setting.refusal(word) is None) is (-100 <= signed <= 600)


@pytest.mark.parametrize(
    ("kind", "word", "refusal"),
    [
        ("uint16", 601, "average takes -10..60 s; register content 601 is 60.1 s"),
        ("uint16", 0xFFFF, "average takes -10..60 s; register content 65535 is 6553.5 s"),
        ("int16", 0xFF00, "average takes -10..60 s; register content 65280 is -25.6 s"),
    ],
)
def test_a_refused_content_is_told_in_the_unit(kind: str, word: int, refusal: str) -> None:
    more = {"type": kind, "scale": 0.1, "unit": "s", "range": [-10, 60], "writable": True}
    assert Setting.model_validate(SETTING | more).refusal(word) == refusal


def test_a_setting_with_values_takes_only_those() -> None:
    setting = Setting.model_validate(SETTING | {"values": {0: "off", 7: "on"}, "writable": True})
    assert setting.refusal(7) is None
    assert setting.refusal(1) == "average takes 0 (off), 7 (on), not 1"


@pytest.mark.parametrize(
    ("more", "wrong"),
    [
        ({"values": {}}, [(("values",), "names no value")]),
        (
            {"values": {1: "on"}, "range": [0, 1]},
            [(("values",), "a setting has either a range or values")],
        ),
        (
            {"values": {70000: "on", "off": "off", -1: "x"}},
            [
                (("values", key), "is no register content; write a whole number from 0 to 65535")
                for key in (70000, "off", -1)
            ],
        ),
    ],
)
def test_the_values_of_a_setting_are_register_contents(more: dict[str, Any], wrong: list[Any]) -> None:
    assert problems(Setting, SETTING | more) == wrong


def test_values_that_are_no_mapping_are_refused() -> None:
    assert [place for place, _ in problems(Setting, SETTING | {"values": [1]})] == [("values",)]


def decoded(value: Value, *words: int) -> Any:  # noqa: ANN401 - a number or a fault
    return value.cell(value.register).decode(words)
