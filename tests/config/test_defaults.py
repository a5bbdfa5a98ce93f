"""What fills the gaps that a file leaves."""

from __future__ import annotations

from typing import Any

import pytest

from lfs10d.config.defaults import resolved, unfit
from lfs10d.config.models import Config

SMALL: dict[str, Any] = {"line": {"port": "/dev/x"}, "slaves": [2, 3, 4], "mqtt": {"host": "localhost"}}


def complete(*, stem: str = "lfs10d", host: str = "gateway", **sections: Any) -> Config:  # noqa: ANN401 - plain data of any shape
    return resolved(Config.model_validate({**SMALL, **sections}), stem=stem, host=host)


def test_the_smallest_file_gets_every_default() -> None:
    assert complete().model_dump() == {
        "line": {
            "name": "line0",
            "port": "/dev/x",
            "baudrate": 9600,
            "parity": "none",
            "databits": 8,
            "stopbits": 1,
            "framing": "rtu",
            "extra_gap": 0.0,
            "turnaround_delay": 0.1,
            "echo": "auto",
            "low_latency": True,
            "realtime": False,
            "rs485": None,
        },
        "poll": {
            "interval": 1.0,
            "response_timeout": None,
            "retries": 1,
            "offline_after": 3,
            "probe_interval_max": 15.0,
        },
        "slaves": tuple(
            {
                "id": number,
                "name": f"slave-{number}",
                "label": None,
                "profile": "lfs10",
                "interval": 1.0,
                "enabled": True,
                "response_timeout": None,
                "request_gap": 0.0,
                "checksum": None,
                "calibration": {},
            }
            for number in (2, 3, 4)
        ),
        "mqtt": {
            "host": "localhost",
            "port": 1883,
            "version": "5",
            "base_topic": "lfs10d",
            "client_id": "lfs10d-gateway-line0",
            "telemetry": True,
            "state_every": 1.0,
            "username": None,
            "password_file": None,
            "tls": None,
            "keepalive": 20.0,
            "hold": 0.02,
        },
        "commands": ("polling", "sensors"),
        "homeassistant": {"discovery": False, "prefix": "homeassistant"},
        "wind": {"every": 10.0, "records": 600.0},
        "store": {"max_size": 512_000_000, "max_age": 604800.0},
        "log": {"level": "info", "format": "auto"},
    }


def test_a_line_without_a_name_is_named_after_the_file() -> None:
    assert [complete(stem=stem).line.name for stem in ("lfs10d", "north")] == ["line0", "north"]


def test_a_line_keeps_the_name_it_is_given() -> None:
    assert complete(stem="north", line={"port": "/dev/x", "name": "south"}).line.name == "south"


def test_a_slave_inherits_what_it_does_not_say() -> None:
    slaves = complete(
        poll={"interval": "2s", "response_timeout": "100ms"},
        slaves=[2, {"id": 3, "interval": 0, "response_timeout": "auto", "name": "top"}],
    ).slaves
    assert [(slave.interval, slave.response_timeout) for slave in slaves] == [(2.0, 0.1), (0.0, None)]
    assert [slave.name for slave in slaves] == ["slave-2", "top"]


def test_the_host_name_stands_where_it_was_asked_for() -> None:
    mqtt = complete(mqtt={"base_topic": "site/%H/wind", "client_id": "wind-%H", "username": "%H"}).mqtt
    assert (mqtt.base_topic, mqtt.client_id, mqtt.username) == ("site/gateway/wind", "wind-gateway", "%H")


@pytest.mark.parametrize(
    ("mqtt", "port"), [({}, 1883), ({"tls": {}}, 8883), ({"tls": {}, "port": 1884}, 1884), ({"tls": None}, 1883)]
)
def test_tls_has_a_port_of_its_own(mqtt: dict[str, Any], port: int) -> None:
    assert complete(mqtt=mqtt).mqtt.port == port


@pytest.mark.parametrize(
    ("mqtt", "host", "wrong"),
    [
        ({"base_topic": "site/%H"}, "gateway", []),
        ({"base_topic": "site/%H"}, "a+b", ["base_topic"]),
        ({"base_topic": "%H"}, "$a", ["base_topic"]),
        ({"base_topic": "site/%H"}, "", ["base_topic"]),
        ({"client_id": "wind-%H"}, "a+b", []),
        ({}, "a\tb", ["client_id"]),
        ({"client_id": "wind"}, "a\tb", []),
        ({"base_topic": "%H/" * 20 + "%H"}, "x" * 64, ["base_topic"]),
    ],
)
def test_what_the_host_name_makes_of_a_key_must_be_allowed_as_well(
    mqtt: dict[str, Any], host: str, wrong: list[str]
) -> None:
    config = Config.model_validate({**SMALL, "mqtt": mqtt})
    found = list(unfit(config, resolved(config, stem="lfs10d", host=host)))
    assert [path for path, _ in found] == [("mqtt", key) for key in wrong]
    assert all("with the name of this host, and must be" in message for _, message in found)
