"""The configuration's models: their defaults, and what they take."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from lfs10d.config.models import Config, MqttConfig, default_line_name, device_name
from lfs10d.schema.fields import Duration, FieldError, FieldKind, Name

SMALL: dict[str, Any] = {"line": {"port": "/dev/x"}, "slaves": [2, 3, 4], "mqtt": {"host": "localhost"}}


def config(**sections: Any) -> Config:  # noqa: ANN401  # any section
    return Config.model_validate({**SMALL, **sections})


@pytest.mark.parametrize(
    ("stem", "name"),
    [
        ("lfs10d", "line0"),
        ("north", "north"),
        ("North Mast", "north-mast"),
        ("a.b", "a-b"),
        ("..", "line0"),
        ("x" * 40, "x" * 32),
    ],
)
def test_a_file_gives_its_line_a_name(stem: str, name: str) -> None:
    assert default_line_name(stem) == name


def test_a_device_without_a_name_is_named_after_its_id() -> None:
    slaves = config(slaves=[2, {"id": 3, "name": "top"}]).slaves
    assert [device_name(slave) for slave in slaves] == ["slave-2", "top"]


@given(st.text())
def test_every_file_name_gives_a_name(stem: str) -> None:
    try:
        Name().accept(default_line_name(stem))
    except FieldError as refused:
        pytest.fail(str(refused))


@pytest.mark.parametrize("version", [5, "5", "3.1.1"])
def test_a_version_is_a_number_or_text_as_yaml_gives_it(version: object) -> None:
    assert config(mqtt={"version": version}).mqtt.version == str(version)


WRONG: list[tuple[str, dict[str, Any], str]] = [
    ("line", {"port": ""}, "must be a path"),
    ("line", {"port": 5}, "must be a path"),
    ("line", {"port": "/dev/x", "baudrate": 14400}, "must be 1200"),
    ("line", {"port": "/dev/x", "baudrate": "9600"}, "must be 1200"),
    ("line", {"port": "/dev/x", "parity": False}, "must be none, even or odd"),
    ("line", {"port": "/dev/x", "databits": 9}, "must be 8 or 7"),
    ("line", {"port": "/dev/x", "extra_gap": -1}, "must be a duration"),
    ("line", {"port": "/dev/x", "echo": True}, "must be auto, on or off"),
    ("line", {"port": "/dev/x", "rs485": {"rts_on_send": 1}}, "must be true or false"),
    ("poll", {"interval": "19ms"}, "must be a duration from 20ms to 24h, or 0"),
    ("poll", {"interval": "25h"}, "must be a duration from 20ms to 24h, or 0"),
    ("poll", {"interval": math.inf}, "not .inf"),
    ("poll", {"interval": math.nan}, "not .nan"),
    ("poll", {"interval": None}, "not empty"),
    ("poll", {"response_timeout": "9ms"}, "must be a duration from 10ms to 10s, or auto"),
    ("poll", {"retries": 1.0}, "must be a whole number"),
    ("mqtt", {"port": 0}, "must be a whole number from 1 to 65535"),
    ("mqtt", {"version": 3.1}, "must be 5 or 3.1.1"),
    ("mqtt", {"base_topic": "$x"}, "not beginning with"),
    ("mqtt", {"keepalive": 0}, "must be a duration from 1s"),
    ("mqtt", {"state_every": "500ms"}, "must be a duration from 1s"),
    ("mqtt", {"state_every": "2h"}, "must be a duration from 1s"),
    ("mqtt", {"telemetry": "yes"}, "must be true or false"),
    ("store", {"max_size": "-1MB"}, "must be a size"),
    ("log", {"level": "trace"}, "must be debug, info, warning or error"),
    ("wind", {"every": "1ms"}, "must be a duration"),
]


@pytest.mark.parametrize(("section", "content", "message"), WRONG)
def test_nothing_is_guessed(section: str, content: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError) as invalid:
        config(**{section: content})
    (detail,) = invalid.value.errors()
    assert message in detail["msg"]


@pytest.mark.parametrize(
    ("slave", "message"),
    [
        ("9", 'must be a slave id, a whole number from 1 to 255, or a mapping with an id, not text "9"'),
        (True, "or a mapping with an id, not true"),
        (None, "or a mapping with an id, not empty"),
        (256, "must be a whole number from 1 to 255, not 256"),
        (0, "must be a whole number from 1 to 255, not 0"),
        ({"id": 2, "name": "Top"}, "must be a name"),
        ({"id": 2, "label": "two\nlines"}, "on one line"),
        ({"id": 2, "checksum": "lrc"}, "must be crc, sum or null"),
    ],
)
def test_a_slave_is_an_id_or_a_mapping(slave: object, message: str) -> None:
    with pytest.raises(ValidationError) as invalid:
        config(slaves=[slave])
    (detail,) = invalid.value.errors()
    assert message in detail["msg"]


@pytest.mark.parametrize("section", ["slaves", "commands"])
@pytest.mark.parametrize("content", [None, {}, "polling", 2])
def test_a_list_is_a_list(section: str, content: object) -> None:
    with pytest.raises(ValidationError, match=r"must be a list, \[\] for none, not"):
        config(**{section: content})


def test_the_configuration_does_not_change_once_it_is_there() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        config().line.baudrate = 19200  # type: ignore[misc]  # that is the claim


def sections(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """Yield a model and all those inside it."""
    yield model
    for field in model.model_fields.values():
        yield from inner(field.annotation)


def inner(annotation: object) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield from sections(annotation)
    for argument in get_args(annotation):
        yield from inner(argument)


SECTIONS: list[type[BaseModel]] = sorted(set(sections(Config)), key=str)


@pytest.mark.parametrize("model", SECTIONS)
def test_every_section_is_strict_and_every_key_explained(model: type[BaseModel]) -> None:
    wanted = {"strict": True, "extra": "forbid", "frozen": True, "allow_inf_nan": False}
    assert wanted.items() <= dict(model.model_config).items()
    assert model.__doc__
    for name, field in model.model_fields.items():
        assert field.description, name
        assert field.description.endswith("."), name


@pytest.mark.parametrize("model", SECTIONS)
def test_every_default_is_what_the_kind_of_its_key_would_take(model: type[BaseModel]) -> None:
    kinds = {
        name: (field.default, kind)
        for name, field in model.model_fields.items()
        for kind in field.metadata
        if isinstance(kind, FieldKind) and not field.is_required() and name != "name"
    }
    for name, (default, kind) in kinds.items():
        written = "auto" if default is None and isinstance(kind, Duration) and kind.auto else default
        assert kind.accept(written) == default, name


def test_one_host_is_one_node() -> None:
    mqtt = MqttConfig.model_validate({"host": "gate", "port": 1884})
    assert (mqtt.nodes, mqtt.broker) == ((("gate", 1884),), "gate:1884")


def test_a_list_of_hosts_is_a_list_of_nodes() -> None:
    mqtt = MqttConfig.model_validate({"host": ["gate", "[::1]:9"], "port": 1884})
    assert (mqtt.nodes, mqtt.broker) == ((("gate", 1884), ("::1", 9)), "gate:1884, [::1]:9")


def test_a_certificate_is_given_as_scale_and_offset_by_value() -> None:
    slave = {"id": 3, "calibration": {"wind_speed": {"scale": 1.013, "offset": 0.06}}}
    config = Config.model_validate({"line": {"port": "/dev/x"}, "slaves": [slave], "mqtt": {"host": "h"}})
    assert config.slaves[0].certificates == {"wind_speed": (1.013, 0.06)}
