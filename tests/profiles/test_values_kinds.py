"""The keys of a value that say which part of its registers is meant, and what it means: every mistake at its place."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from lfs10d.profiles.blocks import batch
from lfs10d.profiles.contents import RegisterContent
from lfs10d.profiles.profile import Profile
from lfs10d.profiles.values import Value

NUMBER = {"name": "level", "register": 1, "type": "uint16", "unit": "m"}
BIT = {"name": "level", "register": 1, "function": 2}
TEXT = {"name": "level", "register": 1, "type": "string", "length": 2}


def problems(data: dict[str, Any]) -> list[tuple[str, str]]:
    with pytest.raises(ValidationError) as caught:
        Value.model_validate(data)
    return [(".".join(map(str, wrong["loc"])), wrong["msg"]) for wrong in caught.value.errors()]


@pytest.mark.parametrize(
    ("data", "place", "message"),
    [
        (NUMBER | {"type": None}, "type", "is missing; write here: int16"),
        (NUMBER | {"type": "bool"}, "type", "registers hold no booleans"),
        (NUMBER | {"type": "uint8"}, "type", "must be one of int16, uint16, int32, uint32, int64, uint64, float32, "),
        (NUMBER | {"type": 16}, "type", "must be one of int16, "),
        ({"name": "x", "register": 1, "type": "uint16", "map": {0: 1}}, "map.0", "must be text of 1 to 64"),
        (BIT | {"type": "uint16"}, "type", "function 1 and 2 read booleans; leave the type out"),
        (NUMBER | {"type": "int64", "register": 0xFFFD}, "type", "int64 fills four registers"),
        (NUMBER | {"length": 2}, "length", "uint16 has its own length; leave it out"),
        (TEXT | {"length": None}, "length", "is missing; write how many registers the text fills"),
        (
            TEXT | {"type": "bcd", "length": 5, "unit": "m"},
            "length",
            "must be a whole number from 1 to 4 for bcd",
        ),
        (TEXT | {"register": 0xFFFF}, "length", "2 registers from there, and 0xFFFF is the last"),
        (TEXT | {"word_order": "high_first"}, "word_order", "text begins in its first register"),
        (NUMBER | {"type": "bcd", "length": 2}, "word_order", "is missing; write high_first or low_first"),
        (BIT | {"byte_order": "little"}, "byte_order", "a boolean has no bytes"),
        (NUMBER | {"bits": [7, 3]}, "bits", "the first bit is greater than the last"),
        (NUMBER | {"bits": [3, 16]}, "bits", "must be bits 0 to 15"),
        (NUMBER | {"mask": 0x1_0000}, "mask", "has more than the 16 bits there are"),
        (NUMBER | {"mask": 0x0F0F}, "mask", "must be one run of ones, such as 0x0FF0"),
        (NUMBER | {"mask": 0xFF, "bits": [0, 7]}, "mask", "bits selects the part already"),
        (NUMBER | {"byte": "low", "mask": 0xFF}, "byte", "mask selects the part already"),
        (NUMBER | {"type": "uint32", "word_order": "high_first", "byte": "low"}, "byte", "is for values of one"),
        (NUMBER | {"type": "bcd", "bits": [0, 3]}, "bits", "selects a part of a whole number, and the type is bcd"),
        (NUMBER | {"map": {}}, "map", "names no content"),
        (TEXT | {"map": {0: "x"}}, "map", "a map is for whole numbers, and the type is string"),
        (NUMBER | {"unavailable": [0x1_0000]}, "unavailable.0", "uint16 holds 0 to 0xFFFF, not 65536"),
        (NUMBER | {"unavailable": [0xFFFF, -1]}, "unavailable.1", "uint16 holds 0 to 0xFFFF, not -1"),
        (NUMBER | {"unavailable": [1.5]}, "unavailable.0", "uint16 holds whole numbers only"),
        (NUMBER | {"unavailable": [True]}, "unavailable.0", "must be a register content"),
        (TEXT | {"scale": 2.0}, "scale", "is for numbers, and this value is text or a boolean"),
        (BIT | {"range": [0, 1]}, "range", "is for numbers, and this value is text or a boolean"),
        (NUMBER | {"map": {0: "x"}, "precision": 1}, "precision", "is for numbers"),
        (NUMBER | {"modulo": 0}, "modulo", "Input should be greater than 0"),
        (NUMBER | {"unit": None}, "unit", "is missing; write here: the unit of the number"),
        (NUMBER | {"interval": "soon"}, "interval", "must be a duration"),
    ],
)
def test_a_mistake_is_told_at_its_place(data: dict[str, Any], place: str, message: str) -> None:
    (found,) = problems(data)
    assert found[0] == place
    assert found[1].startswith(message)


NO_UNIT_WANTED = 'is text or a boolean, which has no unit: leave out unit "m"'


@pytest.mark.parametrize(
    ("keys", "doubts"),
    [
        ({"byte": "high", "map": {0: "dry", 255: "x", 256: "wet"}}, ["map names 256, and the content is 0 to 255"]),
        ({"bits": [3, 4], "map": {4: "wet"}}, ["map names 4, and the content is 0 to 3"]),
        ({"mask": 0xF0, "map": {-1: "wet"}}, ["map names -1, and the content is 0 to 15"]),
        ({"type": "int16", "map": {40000: "wet"}}, ["map names 40000, and the content is -32768 to 32767"]),
        ({"type": "int16", "map": {-1: "wet"}}, []),
        ({"type": None, "function": 1, "map": {2: "wet"}}, ["map names 2, and the content is 0 to 1"]),
        ({"unit": "m"}, []),
        ({"unit": "1", "map": {0: "dry"}}, []),
        ({"unit": "m", "map": {0: "dry"}}, [NO_UNIT_WANTED]),
        ({"unit": "m", "map": {-1: "wet"}}, [NO_UNIT_WANTED, "map names -1, and the content is 0 to 65535"]),
        ({"unit": "m", "type": "string", "length": 2}, [NO_UNIT_WANTED]),
        ({"unit": "m", "type": None, "function": 2}, [NO_UNIT_WANTED]),
    ],
)
def test_a_word_that_cannot_come_and_the_unit_of_a_word_are_doubted(keys: dict[str, Any], doubts: list[str]) -> None:
    value = Value.model_validate({"name": "level", "register": 1, "type": "uint16"} | keys)
    assert list(value.doubts) == doubts
    profile = Profile.model_validate(
        {"name": "p", "title": "P", "values": [{"name": "level", "register": 1, "type": "uint16"} | keys]}
    )
    assert profile.doubts() == tuple(f"level: {doubt}" for doubt in doubts)


@pytest.mark.parametrize(
    ("data", "words", "text"),
    [
        (NUMBER, 1, False),
        (BIT, 1, True),
        (TEXT, 2, True),
        (NUMBER | {"type": "bcd", "length": 3, "word_order": "low_first"}, 3, False),
        (NUMBER | {"type": "float64", "word_order": "low_first"}, 4, False),
        ({"name": "level", "register": 1, "type": "uint16", "map": {0: "dry"}}, 1, True),
    ],
)
def test_a_value_knows_its_registers_and_whether_it_is_text(
    data: dict[str, Any],
    words: int,
    text: bool,  # noqa: FBT001 - a table
) -> None:
    value = Value.model_validate(data)
    assert (value.words, value.end, value.is_text) == (words, 1 + words, text)
    assert value.unit == ("1" if text else "m")


def test_a_wrong_type_hides_no_other_mistake() -> None:
    wrong = NUMBER | {"type": "word", "bits": [3, 99], "unavailable": ["x"], "map": {0: ""}, "length": 70}
    assert {place for place, _ in problems(wrong)} == {"type", "bits.1", "unavailable.0", "map.0", "length"}


def test_a_content_is_described() -> None:
    assert RegisterContent().words.startswith("a register content")


def reads(registers: list[int], **keys: Any) -> list[tuple[int, int, int]]:  # noqa: ANN401  # a file's data
    values = [{"name": f"v{n}", "type": "uint16", "unit": "1", "register": n} for n in registers]
    profile = Profile.model_validate({"name": "p", "title": "P", "values": values, **keys})
    return [(block.function, block.address, block.count) for block in profile.reads()]


def test_a_read_may_span_as_many_unnamed_registers_as_the_profile_permits() -> None:
    assert reads([0, 4, 10]) == [(3, 0, 1), (3, 4, 1), (3, 10, 1)]
    assert reads([0, 4, 10], may_skip=3) == [(3, 0, 5), (3, 10, 1)]
    assert reads([0, 4, 10], may_skip=5, max_words=10) == [(3, 0, 5), (3, 10, 1)]


def test_values_of_another_interval_are_read_apart() -> None:
    plain = {"type": "uint16", "unit": "1"}
    values = [
        Value.model_validate({"name": "a", "register": 0, **plain}),
        Value.model_validate({"name": "b", "register": 1, "interval": "1m", **plain}),
        Value.model_validate({"name": "c", "register": 2, **plain}),
    ]
    assert [(block.address, block.count) for block in batch(values, 125)] == [(0, 1), (2, 1), (1, 1)]


def test_more_bits_than_registers_come_in_one_read() -> None:
    values = [Value.model_validate({"name": f"b{n}", "register": n, "function": 1}) for n in range(40)]
    assert [(block.function, block.count) for block in batch(values, 2)] == [(1, 40)]


@pytest.mark.parametrize(
    ("keys", "place", "message"),
    [
        ({"write_function": 5}, ("write_function",), "Input should be 6 or 16"),
        ({"may_skip": 124}, ("may_skip",), "must be a whole number from 0 to 123, not 124"),
        ({"identify": [{"register": 1, "holds": []}]}, ("identify", 0, "holds"), "names no content"),
        (
            {"identify": [{"register": 1, "holds": [70000]}]},
            ("identify", 0, "holds", 0),
            "must be a whole number from 0",
        ),
    ],
)
def test_keys_of_the_device_are_checked(keys: dict[str, Any], place: tuple[object, ...], message: str) -> None:
    with pytest.raises(ValidationError) as caught:
        Profile.model_validate({"name": "p", "title": "P", "values": [NUMBER], **keys})
    (wrong,) = caught.value.errors()
    assert wrong["loc"] == place
    assert wrong["msg"].startswith(message)
