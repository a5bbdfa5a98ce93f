"""Devices removed and their options changed by requests."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests.support.context import Ask, Asked, FakeContext
from tests.support.device_requests import own_profile, slave

# -- device/remove


def test_what_is_removed_is_gone_after_a_restart(asked: Asked, fake: FakeContext) -> None:
    assert asked("device/remove", device="mast-top") == ("ok", {"device": "mast-top", "slave": 2})
    (told,) = fake.told
    assert (told["request"], told["device"], told["to"]) == ("device/remove", "mast-top", None)
    fake.disk.power_cut()
    fake.start()
    assert [slave.name for slave in fake.holding.now.config.slaves] == ["slave-3"]
    assert asked("device/remove", device="mast-top") == ("rejected", ("unknown_device", "device"))


def test_what_was_added_and_cannot_be_polled_now_can_be_removed(asked: Asked, fake: FakeContext) -> None:
    own_profile(fake)
    asked("device/add", slave=9, profile="own.yaml", probe=False)
    fake.file.with_name("own.yaml").unlink()
    fake.start()
    assert fake.holding.now.slave("slave-9") is None
    assert asked("device/add", slave=9, probe=False) == ("rejected", ("invalid_param", "name"))
    assert asked("device/remove", device="slave-9") == ("ok", {"device": "slave-9", "slave": None})
    assert fake.holding.now.changes.count == 0


# -- device/options


@pytest.mark.parametrize(
    ("wanted", "old", "new"),
    [
        ({"interval": "250ms"}, {"interval": 1.0}, {"interval": 0.25}),
        ({"interval": 0}, {"interval": 1.0}, {"interval": 0.0}),
        ({"enabled": False}, {"enabled": True}, {"enabled": False}),
        ({"label": "Top"}, {"label": None}, {"label": "Top"}),
        ({"response_timeout": "50ms"}, {"response_timeout": "auto"}, {"response_timeout": 0.05}),
        (
            {"label": "Top", "interval": 5},
            {"interval": 1.0, "label": None},
            {"interval": 5.0, "label": "Top"},
        ),
    ],
)
def test_options_are_changed_and_told_from_and_to(
    asked: Asked, fake: FakeContext, wanted: dict[str, Any], old: dict[str, Any], new: dict[str, Any]
) -> None:
    assert asked("device/options", device="mast-top", id=7, **wanted) == ("ok", {"from": old, "to": new})
    assert fake.told == [{"request": "device/options", "id": 7, "device": "mast-top", "from": old, "to": new}]
    held = slave(fake, "mast-top").model_dump()
    assert {key: "auto" if held[key] is None and key == "response_timeout" else held[key] for key in new} == new


def test_options_that_hold_already_are_no_change(asked: Asked, fake: FakeContext) -> None:
    data = {"interval": 1.0, "label": None, "response_timeout": "auto"}
    wanted = {"interval": "1s", "label": None, "response_timeout": "auto"}
    assert asked("device/options", device="mast-top", **wanted) == ("ok", {"from": data, "to": data})
    assert (fake.done, fake.told) == ([], [])


def test_options_of_what_was_added_can_be_changed(asked: Asked, fake: FakeContext) -> None:
    asked("device/add", slave=9, probe=False)
    assert asked("device/options", device="slave-9", interval=5)[0] == "ok"
    assert slave(fake, "slave-9").interval == 5.0


@pytest.mark.parametrize(
    ("parameters", "code", "param"),
    [
        ({"device": "mast-top"}, "invalid_param", None),
        ({"device": "nobody", "enabled": True}, "unknown_device", "device"),
        ({"enabled": True}, "invalid_param", "device"),
        ({"device": "mast-top", "interval": "19ms"}, "invalid_param", "interval"),
        ({"device": "mast-top", "interval": None}, "invalid_param", "interval"),
        ({"device": "mast-top", "enabled": "yes"}, "invalid_param", "enabled"),
        ({"device": "mast-top", "label": "a\nb"}, "invalid_param", "label"),
        ({"device": "mast-top", "response_timeout": 11}, "invalid_param", "response_timeout"),
        ({"device": "mast-top", "name": "x"}, "invalid_param", "name"),
        ({"device": "slow", "interval": "100ms"}, "invalid_param", "interval"),
    ],
)
def test_options_that_cannot_be_are_rejected(
    asked: Asked, fake: FakeContext, parameters: dict[str, Any], code: str, param: str | None
) -> None:
    own_profile(fake)
    fake.file.write_text(fake.file.read_text() + "  - {id: 4, name: slow, profile: own.yaml}\n")
    fake.start()
    assert asked("device/options", **parameters) == ("rejected", (code, param))
    assert (fake.done, fake.told) == ([], [])


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("device/add", {"slave": 9, "probe": False}),
        ("device/remove", {"device": "mast-top"}),
        ("device/options", {"device": "mast-top", "enabled": False}),
    ],
)
def test_what_cannot_be_kept_is_rejected_and_not_done(
    ask: Ask, fake: FakeContext, name: str, parameters: dict[str, Any]
) -> None:
    fake.disk.full = 0
    before = fake.holding.now
    answer = ask(name, json.dumps(parameters))
    assert (answer.status, answer.code) == ("rejected", "storage_full")
    assert answer.message == ("/state/changes.yaml cannot be written: no space left on device; nothing was changed")
    assert fake.holding.now is before
    assert (fake.done, fake.told) == ([], [])
