"""The JSON Schema of lfs10d.yaml accepts what `lfs10d check` accepts, and marks what it refuses, key by key."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from lfs10d.config.json_schema import DRAFT, json_schema
from lfs10d.schema.document import parse
from tests.support.json_schema import Validator

ROOT = Path(__file__).parents[2]
SCHEMA = json_schema()
SHIPPED = ROOT / "config" / "lfs10d.schema.json"
INCOMPLETE = ROOT / "config" / "lfs10d.sample.yaml"
SAMPLES = sorted({*(ROOT / "config").glob("*.yaml")} - {INCOMPLETE})


def wrong(text: str) -> list[str]:
    return sorted(Validator(SCHEMA).mismatches(parse(text, "file.yaml").data))


def test_the_shipped_schema_is_that_of_the_models() -> None:
    assert json.loads(SHIPPED.read_text(encoding="utf-8")) == SCHEMA, "stale: `lfs10d config --schema` > it"
    assert SCHEMA["$schema"] == DRAFT


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda path: path.name)
def test_each_sample_is_accepted_and_names_the_schema_for_editors(sample: Path) -> None:
    text = sample.read_text(encoding="utf-8")
    assert wrong(text) == []
    named = re.match(r"# yaml-language-server: \$schema=(\S+)\n", text)
    assert named is not None
    assert (sample.parent / named[1]).resolve() == SHIPPED


def test_the_sample_that_is_installed_lacks_the_port_alone() -> None:
    text = INCOMPLETE.read_text(encoding="utf-8")
    assert wrong(text) == ["line: required"]
    assert wrong(text.replace("  # port: ", "  port: ")) == []


def test_the_example_of_the_readme_is_accepted() -> None:
    (example,) = re.findall(r"```yaml\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert wrong(example) == []


LINE = "line: {port: /dev/ttyUSB0}\n"


@pytest.mark.parametrize(
    "more",
    [
        "slaves: [1, 2, {id: 3, name: mast, interval: 250ms, checksum: null}]",
        "slaves: [{id: 3, calibration: {wind_speed: {scale: 1.013, offset: -1}, humidity: {}}}]",
        "poll: {interval: 0, response_timeout: auto}",
        "poll: {interval: 1.5s, response_timeout: 0.2}",
        'mqtt: {host: [a, "b:8884"], version: 5, base_topic: site/%H, tls: {}}',
        "mqtt: {host: 192.0.2.7, version: 3.1.1, password_file: null, tls: null}",
        "store: {max_size: 512MB, max_age: 7d}\ncommands: []",
        "store: {max_size: 0}\ncommands: [registers]",
    ],
)
def test_what_is_valid_is_accepted(more: str) -> None:
    assert wrong(LINE + more) == []


@pytest.mark.parametrize(
    ("text", "places"),
    [
        ("slaves: []", [": required"]),
        ("line: {}", ["line: required"]),
        (LINE + "lien: {}", ["lien: additionalProperties"]),
        (LINE + "poll: {intervall: 1}", ["poll.intervall: additionalProperties"]),
        (LINE + "slaves: [{id: 1, colour: red}]", ["slaves[0]: anyOf"]),
        (LINE + "slaves: [0]", ["slaves[0]: anyOf"]),
        (LINE + "slaves: 3", ["slaves: type"]),
        ("line: {port: 5}", ["line.port: type"]),
        ("line: {port: tcp://gateway}", ["line.port: pattern"]),
        ("line: {port: /dev/ttyS0, baudrate: '9600', echo: true}", ["line.baudrate: enum", "line.echo: enum"]),
        (LINE + "poll: {interval: fast}", ["poll.interval: anyOf"]),
        (LINE + "poll: {interval: 1 h}", ["poll.interval: anyOf"]),
        (LINE + "poll: {interval: -1}", ["poll.interval: anyOf"]),
        (LINE + "poll: {retries: true}", ["poll.retries: type"]),
        (LINE + "poll: {retries: 11}", ["poll.retries: maximum"]),
        (LINE + "mqtt: {host: mqtt://broker}", ["mqtt.host: anyOf"]),
        (LINE + "mqtt: {host: []}", ["mqtt.host: anyOf"]),
        (LINE + "mqtt: {base_topic: a/#}", ["mqtt.base_topic: pattern"]),
        (LINE + "mqtt: {base_topic: $SYS}", ["mqtt.base_topic: pattern"]),
        (LINE + "mqtt: {telemetry: yes}", ["mqtt.telemetry: type"]),
        (LINE + "store: {max_size: 1GiB}", ["store.max_size: anyOf"]),
        (LINE + "commands: [everything]", ["commands[0]: enum"]),
        (LINE + "log: {level: null}", ["log.level: enum"]),
    ],
)
def test_an_unknown_key_or_a_wrong_type_is_marked_at_its_place(text: str, places: list[str]) -> None:
    assert wrong(text) == places


def keys(schema: dict[str, Any]) -> dict[str, Any]:
    """Return each key of the file with its entry, the sections with their definition's."""
    entries: dict[str, Any] = {}
    for section, entry in schema["properties"].items():
        entries[section] = entry
        definition = schema["$defs"].get(entry.get("$ref", "").rpartition("/")[2], {"properties": {}})
        entries.update({f"{section}.{key}": inner for key, inner in definition["properties"].items()})
    return entries


def test_every_key_has_a_description_and_its_default_as_it_is_written() -> None:
    entries = keys(SCHEMA)
    assert [key for key, entry in entries.items() if not entry.get("description")] == []
    assert {key: entries[key].get("default", "none") for key in DEFAULTS} == DEFAULTS


DEFAULTS = {
    "line": "none",
    "line.port": "none",
    "line.name": "none",
    "line.extra_gap": "0s",
    "line.rs485": None,
    "poll.interval": "1s",
    "poll.response_timeout": "auto",
    "poll.retries": 1,
    "mqtt.port": "none",
    "mqtt.tls": None,
    "store.max_size": "512MB",
    "store.max_age": "7d",
    "commands": ["polling", "sensors"],
    "slaves": [],
}
