"""Kinds of values: what each accepts, and the message for what it does not."""

from __future__ import annotations

from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from lfs10d.schema.fields import (
    Choice,
    Duration,
    FieldError,
    FieldKind,
    FilePath,
    Flag,
    Name,
    Size,
    Text,
    Whole,
    quoted,
    shown,
)
from lfs10d.schema.quantities import DURATION_PATTERN, SIZE_PATTERN

DURATION = Duration(0.02, 86400.0, zero="as fast as can be", auto="learned")
KINDS: tuple[FieldKind, ...] = (
    Whole(1, 255),
    Flag(),
    Choice((8, 7)),
    Choice(("crc", "sum"), null=True),
    Choice((5, "3.1.1"), meaning={5: "5"}),
    DURATION,
    Duration(1.0, 2.0),
    Size(0, 10**9),
    Name(),
    Text(5),
    Text(5, null=True),
    FilePath(),
)


@pytest.mark.parametrize(
    ("kind", "value", "meant"),
    [
        (Whole(1, 255), 1, 1),
        (Whole(1, 255), 255, 255),
        (Flag(), True, True),
        (Choice((8, 7)), 7, 7),
        (Choice(("a",), null=True), None, None),
        (Choice((5, "3.1.1"), meaning={5: "5", "5": "5"}), "3.1.1", "3.1.1"),
        (Choice(("3.1.1",), meaning={5: "5"}), 5, "5"),
        (DURATION, "auto", None),
        (DURATION, 0, 0.0),
        (DURATION, "20ms", 0.02),
        (DURATION, "24h", 86400.0),
        (Size(0, 10), "10B", 10),
        (Name(), "mast-top_1", "mast-top_1"),
        (Text(5), "Möwe", "Möwe"),
        (Text(5, null=True), None, None),
        (FilePath(), "/dev/ttyUSB0", "/dev/ttyUSB0"),
        (FilePath(null=True), None, None),
    ],
)
def test_what_is_of_the_kind_is_taken(kind: FieldKind, value: object, meant: object) -> None:
    taken = kind.accept(value)
    assert taken == meant
    assert type(taken) is type(meant)


@pytest.mark.parametrize(
    ("kind", "value", "message"),
    [
        (Whole(1, 255), "9", 'must be a whole number from 1 to 255, not text "9"'),
        (Whole(1, 255), True, "must be a whole number from 1 to 255, not true"),
        (Whole(1, 255), 9.0, "must be a whole number from 1 to 255, not 9.0"),
        (Whole(1, 255), 0, "must be a whole number from 1 to 255, not 0"),
        (Whole(1, 255), 10**100, "must be a whole number from 1 to 255, not a huge number"),
        (Flag(), "on", 'must be true or false, not text "on"'),
        (Flag(), 1, "must be true or false, not 1"),
        (Choice((1, 2)), True, "must be 1 or 2, not true"),
        (Choice((1, 2)), 3, "must be 1 or 2, not 3"),
        (Choice((9600,)), "9600", 'must be 9600, not text "9600"'),
        (Choice(("crc", "sum"), null=True), "lrc", 'must be crc, sum or null, not text "lrc"'),
        (Choice(("crc",)), None, "must be crc, not empty"),
        (Choice(("crc",)), [], "must be crc, not an empty list"),
        (Choice(("crc",)), ["crc"], "must be crc, not a list"),
        (
            Duration(1.0, 2.0),
            "auto",
            (
                "must be a duration from 1s to 2s, written as 250ms, 1.5s, 5m, 24h, 7d or a number of seconds, "
                'not text "auto"'
            ),
        ),
        (
            DURATION,
            0.01,
            (
                "must be a duration from 20ms to 24h, or 0 (as fast as can be), or auto (learned), "
                "written as 250ms, 1.5s, 5m, 24h, 7d or a number of seconds, not 0.01"
            ),
        ),
        (Size(1, 10), 11, "must be a size from 1B to 10B, written as 512MB or a number of bytes, not 11"),
        (Size(1, 10), {}, "must be a size from 1B to 10B, written as 512MB or a number of bytes, not a mapping"),
        (Name(), "Mast", 'must be a name of 1 to 32 of the characters a-z 0-9 _ -, not text "Mast"'),
        (Name(), "a\n", 'must be a name of 1 to 32 of the characters a-z 0-9 _ -, not text "a\\n"'),
        (Text(3), "", 'must be text of 1 to 3 characters on one line, without control characters, not text ""'),
        (
            Text(3, null=True),
            "\x1b[2",
            'must be text of 1 to 3 characters on one line, without control characters, or null, not text "\\u001b[2"',
        ),
        (FilePath(), "tcp://x", "must be a path in the file system; network addresses are not supported"),
    ],
)
def test_the_refusal_says_what_is_wrong_and_what_would_be_right(kind: FieldKind, value: object, message: str) -> None:
    with pytest.raises(FieldError) as refused:
        kind.accept(value)
    assert str(refused.value).endswith(message)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (False, "false"),
        (float("inf"), ".inf"),
        (float("-inf"), "-.inf"),
        (float("nan"), ".nan"),
        ((), "an empty list"),
        ((1,), "a list"),
    ],
)
def test_values_are_shown_as_they_are_written(value: object, words: str) -> None:
    assert shown(value) == words


@given(st.text())
def test_quoted_text_is_one_short_line_that_prints(text: str) -> None:
    found = quoted(text)
    assert found.isprintable()
    assert found.isascii() or len(found) >= 3
    assert len(found) <= 2 + 40 * len("\\udbff\\udfff")


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_words(kind: FieldKind) -> None:
    assert kind.words.isprintable()
    assert kind.words[-1] not in ".;,"


@given(
    st.sampled_from(KINDS), st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.lists(st.none())
)
def test_a_kind_takes_a_value_or_refuses_it_in_one_line(kind: FieldKind, value: object) -> None:
    told = ""
    try:
        kind.accept(value)
    except FieldError as refused:
        told = str(refused)
    assert told.isprintable()


def test_pydantic_validates_by_the_kind_alone_and_keeps_braces_in_the_message() -> None:
    class Model(BaseModel):
        name: Annotated[str, Name()]

    assert Model.model_validate({"name": "a"}).name == "a"
    with pytest.raises(ValidationError, match=r'not text "\{x\}"'):
        Model.model_validate({"name": "{x}"})


@pytest.mark.parametrize(
    ("kind", "schema"),
    [
        (Whole(1, 9), {"type": "integer", "minimum": 1, "maximum": 9}),
        (Flag(), {"type": "boolean"}),
        (Choice(("3.1.1", "5"), meaning={5: "5", "5": "5"}), {"enum": ["3.1.1", "5", 5]}),
        (Choice(("crc",), null=True), {"enum": ["crc", None]}),
        (
            Duration(1.0, 2.0),
            {
                "anyOf": [
                    {"type": "number", "minimum": 1.0, "maximum": 2.0},
                    {"type": "string", "pattern": DURATION_PATTERN},
                ]
            },
        ),
        (
            Size(0, 9),
            {"anyOf": [{"type": "integer", "minimum": 0, "maximum": 9}, {"type": "string", "pattern": SIZE_PATTERN}]},
        ),
        (Name(), {"type": "string", "pattern": "^[a-z0-9_-]{1,32}$"}),
        (Text(5), {"type": "string", "minLength": 1, "maxLength": 5}),
        (Text(5, null=True), {"anyOf": [{"type": "string", "minLength": 1, "maxLength": 5}, {"type": "null"}]}),
        (FilePath(), {"type": "string", "minLength": 1, "maxLength": 4096, "pattern": "^(?!.*://)"}),
    ],
)
def test_the_json_schema_is_that_of_the_kind_whatever_the_type_of_the_field(
    kind: FieldKind, schema: dict[str, object]
) -> None:
    class Model(BaseModel):
        value: Annotated[int | str | None, kind]

    assert kind.json_schema() == schema
    assert Model.model_json_schema()["properties"]["value"] == {"title": "Value", **schema}


def test_the_json_schema_has_the_words_for_zero_and_auto() -> None:
    assert DURATION.json_schema()["anyOf"][2:] == [{"const": 0}, {"const": "auto"}]


def test_a_kind_without_a_json_schema_permits_anything_there() -> None:
    class Odd(FieldKind):
        @property
        def words(self) -> str:
            return "odd"

        def accept(self, value: object) -> object:
            return value

    assert Odd().json_schema() == {}
