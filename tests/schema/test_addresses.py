"""Hosts, nodes and base topics: what is accepted, and that a wrong one is never shown."""

from __future__ import annotations

from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from lfs10d.schema.addresses import BaseTopic, Host, Hosts, Node, TopicPrefix, node_text, split_node
from lfs10d.schema.fields import FieldError, FieldKind

KINDS: tuple[FieldKind, ...] = (Host(), Hosts(), Node(), BaseTopic(), TopicPrefix())


@pytest.mark.parametrize(
    ("kind", "value", "meant"),
    [
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


@given(
    st.sampled_from(KINDS), st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.lists(st.none())
)
def test_a_kind_takes_a_value_or_refuses_it_in_one_line(kind: FieldKind, value: object) -> None:
    message = ""
    try:
        kind.accept(value)
    except FieldError as refused:
        message = str(refused)
    assert message.isprintable()
    assert kind.words.isprintable()
    assert kind.words[-1] not in ".;,"


def test_the_json_schema_of_a_host_is_one_or_a_list() -> None:
    one, several = Hosts().json_schema()["anyOf"]
    assert one == Host().json_schema()
    assert several["items"] == Node().json_schema()
    assert (several["minItems"], several["maxItems"], several["uniqueItems"]) == (1, 16, True)
    assert BaseTopic().json_schema()["maxLength"] == 200


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
