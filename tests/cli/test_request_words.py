"""Requests and their parameters as a person reads and types them."""

from __future__ import annotations

from typing import Any

import pytest

from lfs10d.cli.request_words import (
    WIDTH,
    Parameter,
    completions,
    does,
    help_of,
    is_slave_id,
    listing,
    named_device,
    parameters,
)
from lfs10d.commands.handlers.registry import HANDLERS

DEVICES = [{"name": "mast-top", "id": 3}, {"name": "7", "id": 5}, {"name": "crane", "id": 7}, {"id": 9}, "noise"]


def test_the_list_has_every_request_with_every_parameter() -> None:
    lines = list(listing())
    for name in HANDLERS:
        assert any(line.startswith(f"{name}  (") for line in lines)
    assert "      parameters: slave, [name], [label], [profile], [interval], [probe]" in lines


@pytest.mark.parametrize("name", HANDLERS)
def test_the_help_of_a_request_says_what_each_parameter_may_be(name: str) -> None:
    lines = list(help_of(name))
    assert lines[0] == f"Usage: lfs10d request {name} [KEY=VALUE]..."
    assert does(name).split()[0] in lines[2]
    keys = [field.alias or key for key, field in HANDLERS[name].spec.parameters.model_fields.items()]
    after = lines[lines.index("Parameters:") :] if keys else []
    assert [line.strip() for line in after if line.startswith("  ") and line[2] != " "] == keys
    assert all(len(line) <= WIDTH and line.isprintable() for line in lines)
    assert ("It takes no parameters." in lines) is (not keys)


@pytest.mark.parametrize("name", HANDLERS)
def test_every_parameter_has_a_description(name: str) -> None:
    assert all(each.meaning for each in parameters(name))


def test_what_may_be_left_out_says_what_holds_then() -> None:
    (device,) = parameters("device/read")
    assert device == Parameter("device", device.words, None, "Name of the device.", ())
    usual = {each.key: each.usual for each in parameters("device/add")}
    assert (usual["slave"], usual["interval"], usual["probe"], usual["profile"]) == (None, "null", "true", "lfs10")
    assert [each.usual for each in parameters("line/trace")] == ["30s"]
    assert {each.usual for each in parameters("device/options")} == {None, "the present value"}
    (first, *_) = parameters("line/adopt")
    assert first.words.endswith(", or null")
    assert parameters("no/such") == ()


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("mast-top", "mast-top"),
        ("3", "mast-top"),
        ("7", "7"),
        ("5", "7"),
        ("9", "9"),
        ("44", "44"),
        ("0", "0"),
        ("x", "x"),
    ],
)
def test_a_device_is_called_by_its_name_or_by_its_slave_id(text: str, name: str) -> None:
    assert named_device(text, DEVICES) == name


@pytest.mark.parametrize("devices", [None, {}, [], "x"])
def test_where_the_daemon_told_nothing_what_was_typed_is_sent(devices: Any) -> None:  # noqa: ANN401 - any JSON
    assert named_device("3", devices) == "3"


@pytest.mark.parametrize(
    ("text", "may"), [("1", True), ("255", True), ("256", False), ("0", False), ("01", False), ("²", False), (3, False)]
)
def test_a_slave_id_is_a_number_up_to_255(text: object, *, may: bool) -> None:
    assert is_slave_id(text) is may


KNOWN = {"device": ("mast-top", "slave-3"), "profile": ("lfs10", "ld-e")}


@pytest.mark.parametrize(
    ("name", "given", "begun", "words"),
    [
        ("device/options", (), "", ["device=", "interval=", "enabled=", "label=", "response_timeout="]),
        ("device/options", (), "in", ["interval="]),
        ("device/options", ("device=mast-top",), "", ["interval=", "enabled=", "label=", "response_timeout="]),
        ("device/options", (), "device=", ["device=mast-top", "device=slave-3"]),
        ("device/options", (), "device=s", ["device=slave-3"]),
        ("device/options", ("device", "="), "s", ["slave-3"]),
        ("device/options", ("device",), "", ["mast-top", "slave-3"]),
        ("device/options", ("=",), "x", []),
        ("device/options", ("device", "=", "mast-top", "enabled", "="), "", ["true", "false"]),
        ("device/add", (), "profile=l", ["profile=lfs10", "profile=ld-e"]),
        ("line/baudrate", (), "to=19", ["to=19200"]),
        ("device/options", (), "label=", []),
        ("device/options", (), "no=", []),
        ("health", (), "", []),
        ("no/such", (), "", []),
    ],
)
def test_the_tab_key_completes_keys_and_what_they_may_be(
    name: str, given: tuple[str, ...], begun: str, words: list[str]
) -> None:
    assert completions(name, given, begun, KNOWN) == words
