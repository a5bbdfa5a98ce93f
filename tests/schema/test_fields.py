"""What one value may be, and what is said about another."""

from __future__ import annotations

from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from lfs10d.schema.fields import (
    BaseTopic,
    Choice,
    Duration,
    FieldError,
    FieldKind,
    FilePath,
    Flag,
    Host,
    Hosts,
    Name,
    Node,
    Size,
    Text,
    Whole,
    node_text,
    quoted,
    shown,
    split_node,
)

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
    Host(),
    Hosts(),
    Node(),
    BaseTopic(),
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
        (Host(), "broker.local", "broker.local"),
        (Host(), "192.0.2.7", "192.0.2.7"),
        (Hosts(), "192.0.2.7", "192.0.2.7"),
        (Hosts(), ["a", "a:1884"], ("a", "a:1884")),
        (Host(), "fe80::1%eth0", "fe80::1%eth0"),
        (BaseTopic(), "site/%H/wind", "site/%H/wind"),
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
        (Choice(("crc",)), [], "must be crc, not a list"),
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


@pytest.mark.parametrize("topic", ["a//b", "/a", "a/", "a/#", "+", "$SYS", "a\0", "a" * 201, "", 5, None])
def test_a_base_topic_can_begin_every_topic(topic: object) -> None:
    with pytest.raises(FieldError, match="must be 1 to 200 characters as levels joined by /"):
        BaseTopic().accept(topic)


@pytest.mark.parametrize("host", ["mqtt://me:hunter2@broker", "me:hunter2@broker", "broker:1883", "a b", "", 5])
def test_a_wrong_host_is_not_shown_for_it_may_hold_a_login(host: object) -> None:
    with pytest.raises(FieldError) as refused:
        Host().accept(host)
    assert "hunter2" not in str(refused.value)
    assert "no login" in str(refused.value)


@pytest.mark.parametrize(
    ("value", "words"),
    [(False, "false"), (float("inf"), ".inf"), (float("-inf"), "-.inf"), (float("nan"), ".nan"), ((), "a list")],
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
    ("text", "host", "port"),
    [
        ("broker-a", "broker-a", None),
        ("broker-b:8884", "broker-b", 8884),
        ("192.0.2.7:1", "192.0.2.7", 1),
        ("2001:db8::7", "2001:db8::7", None),
        ("::1", "::1", None),
        ("[2001:db8::7]", "2001:db8::7", None),
        ("[2001:db8::7]:1883", "2001:db8::7", 1883),
        ("[fe80::1%eth0]:65535", "fe80::1%eth0", 65535),
    ],
)
def test_a_node_may_have_a_port_of_its_own(text: str, host: str, port: int | None) -> None:
    assert Node().accept(text) == text
    assert split_node(text) == (host, port)
    if port is not None:
        assert node_text(host, port) == text


@pytest.mark.parametrize(
    "text",
    [
        *("", ":1883", "a:", "a:0", "a:65536", "a:123456", "a:b", "mqtt://a", "me:hunter2@a", "a b"),
        *("[a]:1", "[::1", "::1]:1", "[]:1", "[::1]1883", "[[::1]]:1"),
    ],
)
def test_a_wrong_node_is_refused_and_never_shown(text: str) -> None:
    with pytest.raises(FieldError) as refused:
        Node().accept(text)
    assert str(refused.value) == f"must be {Node().words} (no mqtt://, no login)"


@pytest.mark.parametrize("value", [[], ["a", "b", "a"], ["a", "[::1]", "::1"], [f"a{count}" for count in range(17)]])
def test_nodes_are_at_least_one_not_many_and_each_once(value: list[str]) -> None:
    with pytest.raises(FieldError, match="must be a list of 1 to 16 nodes, each once"):
        Hosts().accept(value)


def test_a_wrong_node_in_a_list_is_found_by_its_place() -> None:
    class Model(BaseModel):
        host: Annotated[str | tuple[str, ...], Hosts()]

    with pytest.raises(ValidationError) as refused:
        Model.model_validate({"host": ["a", "b:0", 7]})
    assert [each["loc"] for each in refused.value.errors()] == [("host", 1), ("host", 2)]


def test_a_list_of_nodes_stays_as_it_is_written() -> None:
    class Model(BaseModel):
        host: Annotated[str | tuple[str, ...], Hosts()]

    for host in (["a", "a:1884"], ("a",)):
        assert Model.model_validate({"host": host}).host == tuple(host)
    assert Hosts().accept(["a", "a:1884"]) == ("a", "a:1884")
    assert Model.model_validate({"host": "a"}).host == "a"
