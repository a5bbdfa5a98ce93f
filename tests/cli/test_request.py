"""`KEY=VALUE` as the parameters of a request."""

from __future__ import annotations

import json
from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from lfs10d.cli.request import KeyValueError, content_of
from lfs10d.command import Command
from lfs10d.commands.message import Parameters, parameters_of
from lfs10d.schema.fields import Duration, Flag, Name, Text, Whole


class Everything(Parameters):
    """One parameter of each kind that requests have."""

    device: Annotated[str, Name()] = "x"
    to: Annotated[int, Whole(1, 255)] = 1
    dry_run: Annotated[bool, Flag()] = False
    label: Annotated[str | None, Text(20, null=True)] = None
    timeout: Annotated[float | None, Duration(0.01, 10, auto="learned")] = None
    duration: Annotated[float, Duration(0.1, 600)] = Field(default=30.0, alias="for")
    ids: str | list[int] = "1-255"
    rates: list[int] | None = None


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("device=mast-top", "mast-top"),
        ("device=9", "9"),
        ("device=true", "true"),
        ("device=0x10", "0x10"),
        ("to=9", 9),
        ("to=0x1F", 31),
        ("dry_run=true", True),
        ("dry_run=false", False),
        ("label=Mast, 10 m", "Mast, 10 m"),
        ("label=12", "12"),
        ("label=null", None),
        ("label=a=b", "a=b"),
        ("timeout=auto", "auto"),
        ("timeout=250ms", "250ms"),
        ("timeout=0.5", 0.5),
        ("for=1m", "1m"),
        ("for=5", 5),
        ("ids=1-8,12", "1-8,12"),
        ("ids=[1,2]", "[1,2]"),
        ("to=010", 10),
        ("rates=[9600]", [9600]),
        ("rates=9600", [9600]),
        ("rates=9600, 19200", [9600, 19200]),
        ("rates=null", None),
    ],
)
def test_a_value_is_read_as_the_form_of_the_request_wants_it(argument: str, value: object) -> None:
    content = content_of([argument], Everything)
    (read,) = content.values()
    assert (read, type(read)) == (value, type(value))
    assert isinstance(parameters_of(Everything, Command(parameters=content)), Everything)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("9", 9),
        ("1.5", 1.5),
        ("true", True),
        ("null", None),
        ('"9"', "9"),
        ("[1, 2]", [1, 2]),
        ('{"a": 1}', {"a": 1}),
        ("mast-top", "mast-top"),
        ("1-8", "1-8"),
        ("1,8", "1,8"),
        ("08", 8),
        ("NaN", "NaN"),
        ("-Infinity", "-Infinity"),
        ("", ""),
        ("[" * 100_000, "[" * 100_000),
    ],
)
def test_where_the_form_is_not_known_a_value_is_json_or_else_text(text: str, value: object) -> None:
    content = content_of([f"x={text}"], None)
    assert (content["x"], type(content["x"])) == (value, type(value))


@pytest.mark.parametrize(
    ("argument", "value"), [("to=300", 300), ("to=nine", "nine"), ("dry_run=1", 1), ("what=1", 1), ("rates=a,b", "a,b")]
)
def test_what_no_reading_makes_right_is_left_to_the_daemon_to_refuse(argument: str, value: object) -> None:
    assert list(content_of([argument], Everything).values()) == [value]


def test_an_id_is_always_text() -> None:
    assert content_of(["id=17", "transaction=true"], Everything) == {"id": "17", "transaction": "true"}


@pytest.mark.parametrize("argument", ["", "device", "=mast-top", "device mast-top"])
def test_what_is_no_key_and_value_is_refused(argument: str) -> None:
    with pytest.raises(KeyValueError, match="KEY=VALUE"):
        content_of([argument], None)


def test_a_key_given_twice_is_refused() -> None:
    with pytest.raises(KeyValueError, match="to is given twice"):
        content_of(["to=1", "to=1"], Everything)


@given(st.text(max_size=50), st.booleans())
def test_whatever_is_typed_becomes_json(text: str, known: bool) -> None:  # noqa: FBT001 - both cases of one law
    for key in Everything.model_fields:
        json.dumps(content_of([f"{key}={text}"], Everything if known else None), allow_nan=False)
