"""Home Assistant's discovery of a running daemon, and from its configuration."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from lfs10d.config.loader import load
from lfs10d.daemon.discovery import AnnouncedPrefixes, discovery_payloads
from lfs10d.profiles.library import builtin_names
from lfs10d.system.disk import Disk
from tests.support.brokers import Mosquitto
from tests.support.homeassistant_keys import complaints
from tests.support.sites import Site, View, eventually

LINE = "homeassistant/device/lfs10d_lfs10d_line0/config"


def topic(device: str) -> str:
    return f"homeassistant/device/lfs10d_lfs10d_line0_{device}/config"


def payloads(tmp_path: Path, text: str) -> dict[str, Any]:
    file = tmp_path / "lfs10d.yaml"
    file.write_text("line: {port: /dev/x}\n" + text)
    loaded = load(file)
    return discovery_payloads(loaded.config, loaded.profiles)


def test_nothing_is_announced_unless_it_is_wanted(tmp_path: Path) -> None:
    assert payloads(tmp_path, "slaves: [2]") == {}


@pytest.mark.parametrize("profile", builtin_names())
def test_each_value_of_each_profile_is_an_entity_that_home_assistant_takes(tmp_path: Path, profile: str) -> None:
    found = payloads(
        tmp_path, f"slaves: [{{id: 2, name: a, profile: {profile}}}]\nhomeassistant: {{discovery: true}}\n"
    )
    for payload in found.values():
        assert list(complaints(json.loads(json.dumps(payload)))) == []
    file = tmp_path / "lfs10d.yaml"
    wanted = load(file).profiles[profile]
    assert [key for key in found[topic("a")]["components"] if "-" not in key] == list(wanted.value_names)
    assert found[topic("a")]["device"]["model"] in {wanted.model, wanted.title}


def test_a_bare_number_has_no_unit_and_the_profile_names_the_maker(tmp_path: Path) -> None:
    found = payloads(
        tmp_path, "slaves: [{id: 2, name: a, profile: fuling-dzb}]\nhomeassistant: {discovery: true, prefix: ha/x}"
    )
    device = found["ha/x/device/lfs10d_lfs10d_line0_a/config"]
    assert (device["device"]["manufacturer"], device["device"]["model"]) == ("Fuling", "DZB")
    assert "1" not in {each.get("unit_of_measurement") for each in device["components"].values()}


def test_words_texts_and_booleans_are_announced_as_such(tmp_path: Path) -> None:
    (tmp_path / "station.yaml").write_text(
        "name: station\ntitle: Station\nvalues:\n"
        "- {name: weather, register: 1, type: uint16, map: {0: dry, 1: rain, 2: rain}}\n"
        "- {name: serial, register: 2, type: string, length: 4}\n"
        "- {name: heating, register: 9, function: 2}\n"
    )
    found = payloads(tmp_path, "slaves: [{id: 2, name: a, profile: station.yaml}]\nhomeassistant: {discovery: true}\n")[
        topic("a")
    ]
    shown = found["components"]
    assert (shown["weather"]["device_class"], shown["weather"]["options"]) == ("enum", ["dry", "rain"])
    assert (shown["serial"]["platform"], shown["heating"]["platform"]) == ("sensor", "binary_sensor")
    assert list(complaints(found)) == []


@pytest.mark.parametrize(("unit", "shown"), [("m/s", "wind_speed"), ("km/h", "wind_speed"), ("furlong", None)])
def test_wind_is_shown_of_a_speed_that_has_statistics_in_its_unit(tmp_path: Path, unit: str, shown: str | None) -> None:
    (tmp_path / "cup.yaml").write_text(
        "name: cup\ntitle: Cup\nvalues:\n"
        f"- {{name: speed, register: 1, type: uint16, unit: {unit}, device_class: wind_speed}}\n"
    )
    found = payloads(tmp_path, "slaves: [{id: 2, name: a, profile: cup.yaml}]\nhomeassistant: {discovery: true}\n")
    gust = found[topic("a")]["components"].get("wind-gust", {})
    assert (gust.get("device_class"), gust.get("unit_of_measurement")) == (shown, unit if shown else None)


def test_prefixes_are_kept_and_a_damaged_file_is_none(tmp_path: Path) -> None:
    prefixes, file = AnnouncedPrefixes(tmp_path, Disk()), tmp_path / "homeassistant"
    assert prefixes.load() == set()
    prefixes.save(frozenset({"b/c", "a"}))
    assert prefixes.load() == {"a", "b/c"}
    assert file.read_text() == "a\nb/c\n"
    file.write_bytes(b"a\n+/#\n\n")
    assert prefixes.load() == {"a"}
    file.write_bytes(b"\xff")
    assert prefixes.load() == set()
    prefixes.save(frozenset())
    assert not file.exists()
    AnnouncedPrefixes(tmp_path / "missing", Disk()).save(frozenset("a"))  # the disk is of no use


def test_it_is_announced_taken_back_and_follows_every_change(site: Site, mosquitto: Mosquitto, view: View) -> None:
    def announced() -> dict[str, Any]:
        return {
            name: json.loads(content)
            for name, content in mosquitto.retained("homeassistant/#").items()
            if name != "homeassistant/status"
        }

    slaves: list[object] = [1, {"id": 2, "name": "mast", "label": "Mast {{ 1 }}"}]
    site.line((1, 2))
    site.write(slaves=slaves, homeassistant={"discovery": True})
    run = site.run()
    view.wait_samples("mast", 1)
    eventually(lambda: set(announced()) == {LINE, topic("slave-1"), topic("mast")}, "all are announced")
    assert announced()[topic("mast")]["device"]["name"] == "Mast {{ 1 }}"
    assert not [complaint for each in announced().values() for complaint in complaints(each)]

    site.write(slaves=slaves[1:], homeassistant={"discovery": True}, commands=["sensors"])
    listener = mosquitto.subscribe("homeassistant/#")
    run.reload()
    eventually(lambda: set(announced()) == {LINE, topic("mast")}, "the removed device is cleared")
    eventually(lambda: "read-now" not in announced()[topic("mast")]["components"], "the control is left out")
    told = [json.loads(each.payload)["components"].get("read-now") for each in listener.on(topic("mast"))]
    assert told[-2:] == [{"platform": "button"}, None]

    listener.heard.clear()
    mosquitto.publish("homeassistant/status", "online")
    eventually(lambda: {LINE, topic("mast")} <= {each.topic for each in listener.heard}, "announced anew")

    site.write(slaves=slaves)
    run.reload()
    eventually(lambda: announced() == {}, "switched off")
