"""`lfs10d config` as a person calls it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from lfs10d.cli.config import command
from lfs10d.configfile import load

TEXT = """\
line: {port: /dev/x, extra_gap: 0.5ms}
poll: {interval: 2s, response_timeout: auto}
slaves: [2, {id: 3, label: "Mast, 10 m", enabled: true}]
mqtt: {host: broker, username: me, password_file: secret, base_topic: site/%H, tls: {}}
store: {max_size: 5MB}
"""


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def config(*arguments: str, text: str = TEXT) -> str:
    Path("lfs10d.yaml").write_text(text)
    Path("secret").write_text("hunter2")
    result = CliRunner().invoke(command, ["-c", "lfs10d.yaml", *arguments], catch_exceptions=False)
    assert "hunter2" not in result.output
    assert result.exit_code == 0
    return result.stdout


def test_every_value_stands_beside_its_origin_as_one_would_write_it() -> None:
    rows = {line.split()[0]: line.split()[1:] for line in config().splitlines()}
    assert rows["key"] == ["value", "origin"]
    assert rows["line.extra_gap"] == ["0.5ms", "lfs10d.yaml:1"]
    assert rows["line.rs485"] == ["null", "default"]
    assert rows["line.low_latency"] == ["true", "default"]
    assert rows["poll.interval"] == ["2s", "lfs10d.yaml:2"]
    assert rows["slaves[0].id"] == ["2", "lfs10d.yaml:3"]
    assert rows["slaves[0].interval"] == ["2s", "lfs10d.yaml:2", "(poll.interval)"]
    assert rows["slaves[1].label"] == ["Mast,", "10", "m", "lfs10d.yaml:3"]
    assert rows["slaves[1].response_timeout"] == ["auto", "lfs10d.yaml:2", "(poll.response_timeout)"]
    assert rows["mqtt.port"] == ["8883", "default"]
    assert rows["mqtt.tls.ca"] == ["null", "default"]
    assert rows["store.max_size"] == ["5MB", "lfs10d.yaml:5"]
    assert rows["commands"] == ['["polling",', '"sensors"]', "default"]


def test_no_slaves_are_an_empty_list() -> None:
    rows = [line.split() for line in config(text="line: {port: x}\nslaves: []").splitlines()]
    assert ["slaves", "[]", "lfs10d.yaml:2"] in rows


def test_a_program_gets_the_same_as_json() -> None:
    found = json.loads(config("--json"))
    assert found["config"]["poll"]["interval"] == 2.0
    assert found["config"]["slaves"][1]["label"] == "Mast, 10 m"
    assert found["origins"]["mqtt.host"] == "lfs10d.yaml:4"


def test_merged_is_yaml_that_gives_the_same_configuration() -> None:
    merged = config("--merged")
    before = load(Path("lfs10d.yaml"), environment={}, host="gateway").config
    Path("lfs10d.yaml").write_text(merged)
    assert load(Path("lfs10d.yaml"), environment={}, host="gateway").config == before
    assert "site/%H" in merged


def test_merged_is_yaml_and_not_json() -> None:
    result = CliRunner().invoke(command, ["--merged", "--json"])
    assert result.exit_code == 2
    assert "--merged prints YAML; leave --json out" in result.stderr
