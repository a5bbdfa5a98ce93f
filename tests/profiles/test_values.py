"""Values and settings: what is accepted, and what may be written."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from lfs10d.profiles.calibration import Calibration
from lfs10d.profiles.facts import RESERVED_NAMES
from lfs10d.profiles.values import Value
from lfs10d.reading import Fault, FaultCode
from lfs10d.telemetry.publication import Sample

VALUE = {"name": "level", "register": 1, "type": "uint16", "unit": "m"}
SETTING = {"name": "average", "register": 16}


def problems(model: type[Value], data: dict[str, Any]) -> list[tuple[tuple[int | str, ...], str]]:
    with pytest.raises(ValidationError) as caught:
        model.model_validate(data)
    return [(wrong["loc"], wrong["msg"]) for wrong in caught.value.errors()]


@pytest.mark.parametrize("name", ["level", "l", "wind_speed_2m", "x" * 48])
def test_a_value_is_named_in_snake_case(name: str) -> None:
    assert Value.model_validate(VALUE | {"name": name}).name == name


@pytest.mark.parametrize("name", ["", "Level", "wind-speed", "2m", "_x", "x" * 49, "level ", "pegel_ü", 7, None])
def test_another_name_is_refused(name: object) -> None:
    ((place, message),) = problems(Value, VALUE | {"name": name})
    assert place == ("name",)
    assert message.startswith("must be a name of 1 to 48 of the characters a-z 0-9 _ that begins with a letter")


@pytest.mark.parametrize("name", sorted(RESERVED_NAMES))
def test_a_value_cannot_hide_a_key_of_the_sample(name: str) -> None:
    wanted = f"is a key of every sample already; choose another, such as raw_{name}"
    assert problems(Value, VALUE | {"name": name}) == [(("name",), wanted)]


@pytest.mark.parametrize("units", [{"level": "m"}, {"level": "m", "depth": "m"}])
def test_the_reserved_names_are_the_keys_of_every_sample(units: dict[str, str]) -> None:
    sample = Sample(
        device="mast",
        boot="k3f9a2c7",
        seq=1,
        ts=0,
        clock="synced",
        values=dict.fromkeys(units, 1.0),
        units=units,
        names=tuple(units),
        quality="good",
        error=None,
        rtt_ms=1.0,
    )
    assert set(sample.payload("line0", historical=True)) - set(units) <= RESERVED_NAMES


@pytest.mark.parametrize("scale", [0, -0.0, 1e-13, -1e13, True, "0.1", None])
def test_a_scale_that_leads_nowhere_is_refused(scale: object) -> None:
    ((place, message),) = problems(Value, VALUE | {"scale": scale})
    assert place == ("scale",)
    assert message.startswith("must be a number from 1e-12 to 1e12, or its negative, not ")


@given(
    scale=st.floats(1e-12, 1e12) | st.floats(-1e12, -1e-12),
    offset=st.floats(-1e12, 1e12),
    word=st.integers(0, 0xFFFF),
)
def test_every_accepted_scale_and_offset_give_a_number(scale: float, offset: float, word: int) -> None:
    value = Value.model_validate(VALUE | {"scale": scale, "offset": offset})
    assert isinstance(value.cell(1).decode((word,)), int | float)


def test_two_registers_need_a_word_order_for_a_guess_would_give_a_wrong_number() -> None:
    wanted = "is missing; write high_first or low_first: which of two registers holds the high half"
    assert problems(Value, VALUE | {"type": "float32"}) == [(("word_order",), wanted)]


def test_one_register_has_no_word_order() -> None:
    wanted = "uint16 fills one register; leave the word order out"
    assert problems(Value, VALUE | {"word_order": "high_first"}) == [(("word_order",), wanted)]


def test_a_wrong_type_is_the_only_problem_of_its_word_order() -> None:
    (wrong,) = problems(Value, VALUE | {"type": "double", "word_order": "high_first"})
    assert wrong[0] == ("type",)


def test_a_value_ends_within_the_registers() -> None:
    assert Value.model_validate(VALUE | {"register": 0xFFFF}).end == 0x10000
    wide = VALUE | {"register": 0xFFFF, "type": "int32", "word_order": "low_first"}
    assert problems(Value, wide) == [(("type",), "int32 fills two registers, and 0xFFFF is the last")]


@pytest.mark.parametrize("register", [-1, 0x10000, "1", 1.0, True, None])
def test_a_register_is_an_address_of_16_bits(register: object) -> None:
    assert ("register",) in [place for place, _ in problems(Value, VALUE | {"register": register})]


def test_facts_do_not_change_after_loading() -> None:
    value = Value.model_validate(VALUE)
    with pytest.raises(ValidationError):
        value.unit = "ft"  # type: ignore[misc]  # that it is frozen is the claim


def decoded(value: Value, *words: int) -> Any:  # noqa: ANN401 - a number or a fault
    return value.cell(value.register).decode(words)


def test_a_calibrated_number_is_judged_by_the_range() -> None:
    value = Value.model_validate(VALUE | {"scale": 0.1, "range": [0, 10]})
    assert decoded(value, 99) == 9.9
    assert decoded(value.calibrated(1.1, 0.0), 90) == 9.9
    assert decoded(value.calibrated(1.1, 0.0), 99).message == "level 10.89 m is outside 0..10 m"
    assert decoded(value.calibrated(1.0, -1.0), 9).code is FaultCode.OUT_OF_RANGE
    assert decoded(value.calibrated(1.0, -1.0), 105) == 9.5


@pytest.mark.parametrize("names", [{"name": "wind_speed"}, {"name": "gust", "device_class": "wind_speed"}])
def test_a_wind_speed_of_nothing_stays_nothing(names: dict[str, str]) -> None:
    speed = Value.model_validate(VALUE | {"scale": 0.1} | names).calibrated(1.0, 0.5)
    assert (decoded(speed, 0), decoded(speed, 1)) == (0.0, 0.6)
    assert decoded(Value.model_validate(VALUE | {"scale": 0.1}).calibrated(1.0, 0.5), 0) == 0.5


def test_a_number_that_its_calibration_makes_infinite_is_none() -> None:
    cell = replace(Value.model_validate(VALUE | {"scale": 0.5}).cell(1), calibration=Calibration(1e308, 0.0))
    fault = cell.decode((0xFFFF,))
    assert fault == Fault(FaultCode.NOT_FINITE, "level is infinite with its calibration")


@pytest.mark.parametrize(
    ("data", "wrong"),
    [
        (
            VALUE | {"type": "float32", "word_order": "low_first", "bits": [0, 3]},
            [(("bits",), "selects a part of a whole number, and the type is float32")],
        ),
        (VALUE | {"bits": [0, 3], "byte": "low"}, [(("byte",), "bits selects the part already")]),
        (VALUE | {"bits": [9, 16]}, [(("bits",), "must be bits 0 to 15")]),
        (
            {"name": "on", "register": 1, "function": 1, "unit": "1", "byte_order": "little"},
            [(("byte_order",), "a boolean has no bytes; leave the byte order out")],
        ),
        (
            VALUE | {"type": "float32", "word_order": "low_first", "map": {0: "dry"}},
            [(("map",), "a map is for whole numbers, and the type is float32")],
        ),
        (VALUE | {"map": {}}, [(("map",), "names no content")]),
        (VALUE | {"type": "int17", "byte": "low", "map": {0: "a"}, "unavailable": [7]}, [(("type",), None)]),
    ],
)
def test_a_part_and_its_words_fit_the_type(data: dict[str, Any], wrong: list[tuple[Any, str | None]]) -> None:
    """A type with an error of its own binds nothing else."""
    found = problems(Value, data)
    assert [place for place, _ in found] == [place for place, _ in wrong]
    assert all(message in {None, said} for (_, message), (_, said) in zip(wrong, found, strict=True))


def test_the_bytes_of_any_register_may_be_swapped() -> None:
    assert decoded(Value.model_validate(VALUE | {"byte_order": "little"}), 0x1234) == 0x3412


def test_a_raw_number_is_shown_where_the_calibrated_one_is_believed() -> None:
    value = Value.model_validate(VALUE | {"range": [0, 10]}).calibrated(0.5, 0, shows_raw=True)
    assert decoded(value, 20) == 20
    assert decoded(value, 21).message == "level 10.5 m is outside 0..10 m"
