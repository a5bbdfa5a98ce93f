"""What is wrong between keys that are each right."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lfs10d.config.models import Config
from lfs10d.config.validation import contradictions
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.profiles.values import Value
from lfs10d.schema.document import path_text


def profile(**facts: Any) -> Profile:  # noqa: ANN401  # any fact
    value = {"name": "level", "register": 1, "type": "uint16", "unit": "1"}
    return Profile.model_validate({"name": "gauge", "title": "Gauge", "values": [value], **facts})


PROFILES = {
    "lfs10": load_profile("lfs10", relative_to=Path()),
    "narrow": profile(ids=[1, 9], framings=["rtu", "ascii"], checksums=["crc"], min_interval=0.5),
    "summed": profile(framings=["rtu"], checksums=["crc", "sum"]),
}


def found(**sections: Any) -> list[str]:  # noqa: ANN401 - plain data of any shape
    line = {"port": "/dev/x", **sections.pop("line", {})}
    config = Config.model_validate({"line": line, **sections})
    return [f"{path_text(each.path)}: {each.message}" for each in contradictions(config, PROFILES)]


@pytest.mark.parametrize(
    ("sections", "messages"),
    [
        ({}, []),
        ({"slaves": [1, 2, 255]}, []),
        ({"line": {"databits": 7}}, ["line.databits: must be 8 with framing rtu; 7 goes with ascii only"]),
        ({"line": {"databits": 7, "framing": "ascii"}}, []),
        (
            {"line": {"framing": "ascii"}, "slaves": [2]},
            ["slaves[0].profile: profile lfs10 speaks rtu only, and line.framing is ascii"],
        ),
        ({"line": {"framing": "ascii"}, "slaves": [{"id": 2, "profile": "narrow"}]}, []),
        (
            {"line": {"framing": "ascii"}, "slaves": [{"id": 2, "profile": "narrow", "checksum": "crc"}]},
            ["slaves[0].checksum: must be left out on an ascii line: its frames always carry an LRC"],
        ),
        ({"slaves": [2, 3, 2]}, ["slaves[2].id: id 2 is taken by slaves[0]; every slave needs its own"]),
        (
            {"slaves": [{"id": 2, "name": "a"}, {"id": 3, "name": "a"}]},
            ["slaves[1].name: the name a is taken by slaves[0]; every slave needs its own"],
        ),
        (
            {"slaves": [{"id": 3, "name": "slave-2"}, 2]},
            ["slaves[1]: its default name slave-2 is taken by slaves[0]; give it a name"],
        ),
        (
            {"slaves": [2, {"id": 3, "name": "slave-2"}]},
            ["slaves[1].name: the name slave-2 is taken by slaves[0]; every slave needs its own"],
        ),
        (
            {"slaves": [{"id": 2, "name": "a"}, {"id": 2, "name": "a"}]},
            [
                "slaves[1].id: id 2 is taken by slaves[0]; every slave needs its own",
                "slaves[1].name: the name a is taken by slaves[0]; every slave needs its own",
            ],
        ),
        (
            {"slaves": [{"id": 10, "profile": "narrow"}]},
            ["slaves[0].id: must be from 1 to 9 for profile gauge"],
        ),
        (
            {"slaves": [{"id": 1, "profile": "narrow", "checksum": "sum"}]},
            ["slaves[0].checksum: must be crc for profile gauge"],
        ),
        ({"slaves": [{"id": 1, "profile": "summed", "checksum": "sum"}]}, []),
        (
            {"slaves": [{"id": 1, "profile": "narrow", "interval": "400ms"}]},
            ["slaves[0].interval: must be at least 500ms for profile gauge, or 0"],
        ),
        (
            {"poll": {"interval": "400ms"}, "slaves": [{"id": 1, "profile": "narrow"}]},
            ["slaves[0].interval: must be at least 500ms for profile gauge, or 0"],
        ),
        ({"slaves": [{"id": 1, "profile": "narrow", "interval": 0}]}, []),
        ({"slaves": [{"id": 1, "profile": "not loaded"}]}, []),
        # By MQTT 5 too, though its packets could carry one (contract, section 1): no client library sends it.
        (
            {"mqtt": {"password_file": "p"}},
            ["mqtt.password_file: needs mqtt.username: a password without a user name is never sent"],
        ),
        (
            {"mqtt": {"password_file": "p", "version": "3.1.1"}},
            ["mqtt.password_file: needs mqtt.username: a password without a user name is never sent"],
        ),
        ({"mqtt": {"password_file": "p", "version": "3.1.1", "username": "me"}}, []),
        ({"mqtt": {"tls": {"key": "k"}}}, ["mqtt.tls.key: needs mqtt.tls.cert, the certificate it belongs to"]),
        ({"mqtt": {"tls": {"key": "k", "cert": "c"}}}, []),
    ],
)
def test_impossible_combinations_are_told_at_the_key_to_change(sections: dict[str, Any], messages: list[str]) -> None:
    assert found(**sections) == messages


def test_a_contradiction_rests_on_every_key_it_compares() -> None:
    config = Config.model_validate({"line": {"port": "/dev/x", "databits": 7}, "slaves": [2, 2]})
    assert [set(each.on) for each in contradictions(config, PROFILES)] == [
        {("line", "databits"), ("line", "framing")},
        {("slaves", 0, "id"), ("slaves", 1, "id")},
    ]


def calibrated(*names: str) -> list[dict[str, object]]:
    return [{"id": 2, "calibration": {name: {"scale": 1.013} for name in names}}]


def test_what_is_calibrated_is_a_value_of_the_profile() -> None:
    assert found(slaves=calibrated("wind_speed")) == []
    assert found(slaves=calibrated("wind_sped", "rain")) == [
        "slaves[0].calibration.wind_sped: is no value of profile lfs10; did you mean wind_speed?",
        "slaves[0].calibration.rain: is no value of profile lfs10; its values: wind_speed",
    ]
    (wrong,) = contradictions(Config.model_validate({"line": {"port": "x"}, "slaves": calibrated("rain")}), PROFILES)
    assert wrong.key


def test_only_a_number_is_calibrated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Value, "is_text", property(lambda _: True))
    assert found(slaves=calibrated("wind_speed")) == [
        "slaves[0].calibration.wind_speed: is published as text or true and false; only a number can be calibrated"
    ]
