"""The difference of two configurations as effects."""

from __future__ import annotations

from typing import Any

import pytest

from lfs10d.config.defaults import resolved
from lfs10d.config.diff import Change, difference
from lfs10d.config.models import Config


def config(*, line: dict[str, Any] | None = None, **sections: Any) -> Config:  # noqa: ANN401 - plain data of any shape
    content = {"line": {"port": "/dev/x", **(line or {})}, **sections}
    return resolved(Config.model_validate(content), stem="lfs10d", host="gateway")


def test_nothing_changed_is_nothing_to_do() -> None:
    found = difference(config(slaves=[2]), config(slaves=[2]))
    assert found.applied == found.restart_required == ()
    assert found.target == config(slaves=[2])


@pytest.mark.parametrize(
    ("old", "new", "changed"),
    [
        ({}, {"line": {"baudrate": 19200}}, [Change("line.baudrate", 9600, 19200)]),
        ({}, {"commands": []}, [Change("commands", ("polling", "sensors"), ())]),
        ({}, {"log": {"level": "debug"}}, [Change("log.level", "info", "debug")]),
        (
            {"slaves": [2]},
            {"slaves": [{"id": 7, "name": "slave-2", "label": "Top"}]},
            [Change("slaves.slave-2.id", 2, 7), Change("slaves.slave-2.label", None, "Top")],
        ),
        (
            {"slaves": [2]},
            {"slaves": [2], "poll": {"interval": 2}},
            [Change("poll.interval", 1.0, 2.0), Change("slaves.slave-2.interval", 1.0, 2.0)],
        ),
    ],
)
def test_every_key_that_changed_is_named(old: dict[str, Any], new: dict[str, Any], changed: list[Change]) -> None:
    found = difference(config(**old), config(**new))
    assert list(found.changed) == changed
    assert found.applied == tuple(change.key for change in changed)
    assert found.restart_required == ()


def test_a_section_that_may_be_null_changes_as_a_whole() -> None:
    found = difference(config(), config(mqtt={"tls": {}}))
    assert found.applied == ("mqtt.port", "mqtt.tls")


def test_devices_go_by_their_names_not_by_their_order_or_ids() -> None:
    old = config(slaves=[{"id": 1, "name": "a"}, {"id": 2, "name": "b"}])
    new = config(slaves=[{"id": 3, "name": "c"}, {"id": 1, "name": "a"}])
    found = difference(old, new)
    assert (found.added, found.removed, found.changed) == (("c",), ("b",), ())
    assert found.applied == ("slaves.c", "slaves.b")


def test_what_every_topic_stands_under_waits_for_a_restart_and_the_rest_applies() -> None:
    old = config(slaves=[2])
    new = config(line={"name": "north", "baudrate": 19200}, slaves=[2], mqtt={"base_topic": "site"})
    found = difference(old, new)
    assert found.restart_required == ("line.name", "mqtt.base_topic")
    assert found.applied == ("line.baudrate",)
    assert found.target.line.name == "line0"
    assert found.target.mqtt == old.mqtt  # the client id that was made of the line's name included


def test_a_client_id_of_its_own_changes_at_once_though_the_line_s_name_waits() -> None:
    found = difference(config(), config(line={"name": "north"}, mqtt={"client_id": "me"}))
    assert found.applied == ("mqtt.client_id",)
    assert found.target.mqtt.client_id == "me"


def test_a_restart_alone_is_a_difference_too() -> None:
    found = difference(config(), config(mqtt={"base_topic": "site"}))
    assert (found.applied, found.restart_required) == ((), ("mqtt.base_topic",))


def test_another_calibration_is_a_change_of_its_device() -> None:
    old = config(slaves=[{"id": 2, "name": "a"}])
    new = config(slaves=[{"id": 2, "name": "a", "calibration": {"wind_speed": {"scale": 1.1}}}])
    assert [change.key for change in difference(old, new).changed] == ["slaves.a.calibration"]
    assert difference(new, new).applied == ()
