"""`lfs10d config` as a person calls it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from lfs10d.cli.config import command
from lfs10d.config.changes import Changes
from lfs10d.config.changes_file import FILE_NAME, ChangesFile
from lfs10d.config.effective import file_values_of
from lfs10d.config.json_schema import json_schema
from lfs10d.config.loader import load
from lfs10d.errors import FailedError, StateError
from lfs10d.system.disk import Disk

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
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "state"))


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


def changed(directory: str = "state") -> None:
    """Leave what a daemon leaves: slave-2 is polled every 250 ms, slave-3 no more, roof is new."""
    Path("lfs10d.yaml").write_text(TEXT)
    Path("secret").write_text("hunter2")
    file = file_values_of(load(Path("lfs10d.yaml")))
    changes = Changes().setting("slave-2", {"interval": 0.25, "response_timeout": 0.1}, file).removing("slave-3", file)
    Path(directory).mkdir()
    ChangesFile(Path(directory), Disk()).save(changes.adding("roof", {"id": 9, "label": "Roof"}))


def test_what_requests_changed_is_shown_as_such() -> None:
    changed()
    rows = {line.split()[0]: line.split()[1:] for line in config().splitlines()}
    assert rows["slaves[0].interval"] == ["250ms", "changes.yaml"]
    assert rows["slaves[0].response_timeout"] == ["100ms", "changes.yaml"]
    assert rows["slaves[0].id"] == ["2", "lfs10d.yaml:3"]
    assert rows["slaves[1].name"] == ["roof", "changes.yaml"]
    assert rows["slaves[1].interval"] == ["2s", "lfs10d.yaml:2", "(poll.interval)"]
    assert rows["slaves[1].enabled"] == ["true", "default"]
    assert "slaves[2].id" not in rows


def test_merged_holds_what_requests_changed_and_then_no_change_is_left() -> None:
    changed()
    before = json.loads(config("--json"))["config"]
    merged = config("--merged")
    after = json.loads(config("--json", text=merged))
    assert after["config"] == before
    assert "changes.yaml" not in after["origins"].values()
    assert config("--merged", text=merged) == merged


def test_what_does_not_fit_the_file_any_more_is_told() -> None:
    changed()
    result = CliRunner().invoke(command, ["-c", "lfs10d.yaml"], catch_exceptions=False)
    assert result.stderr == ""
    Path("lfs10d.yaml").write_text(TEXT.replace("[2,", "[{id: 2, interval: 3s}, {id: 9, name: nine},"))
    result = CliRunner().invoke(command, ["-c", "lfs10d.yaml"], catch_exceptions=False)
    assert result.exit_code == 0
    lost, conflict = result.stderr.splitlines()
    assert lost.startswith("lfs10d: slaves.slave-2.interval: the file has another value now")
    assert conflict.startswith("lfs10d: roof: slave id 9 is taken by nine")


def test_merged_refuses_what_no_file_can_say() -> None:
    changed()
    Path("lfs10d.yaml").write_text(TEXT.replace("[2,", "[2, {id: 9, name: nine},"))
    runner = CliRunner()
    with pytest.raises(FailedError, match="roof is not polled, for slave id 9 is taken by nine; change the id of one"):
        runner.invoke(command, ["-c", "lfs10d.yaml", "--merged"], catch_exceptions=False)


def test_another_state_directory_may_be_named() -> None:
    changed("elsewhere")
    assert "changes.yaml" in config("--state-dir", "elsewhere")
    assert "changes.yaml" not in config()


@pytest.mark.parametrize("arguments", [[], ["--merged"], ["--json"]])
@pytest.mark.parametrize("state", ["a file", "no changes", "named and missing", "a folder for a file"])
def test_half_the_truth_is_never_told(state: str, arguments: list[str]) -> None:
    Path("lfs10d.yaml").write_text(TEXT)
    match state:
        case "a file":
            Path("state").write_text("")
        case "no changes":
            Path("state").mkdir()
            Path("state", FILE_NAME).write_text("nonsense: true")
        case "named and missing":
            arguments = [*arguments, "--state-dir", "nowhere"]
        case _:
            Path("state", FILE_NAME).mkdir(parents=True)
    with pytest.raises(StateError):
        CliRunner().invoke(command, ["-c", "lfs10d.yaml", *arguments], catch_exceptions=False, standalone_mode=False)


def test_a_list_of_nodes_is_shown_and_merged_as_one_would_write_it() -> None:
    text = TEXT.replace("host: broker", 'host: [a, "b:8884", "[::1]"]')
    assert text != TEXT
    rows = {line.split()[0]: line.split()[1:] for line in config(text=text).splitlines()}
    assert rows["mqtt.host"] == ['["a",', '"b:8884",', '"[::1]"]', "lfs10d.yaml:4"]
    merged = config("--merged", text=text)
    before = load(Path("lfs10d.yaml"), environment={}, host="gateway").config
    Path("lfs10d.yaml").write_text(merged)
    assert load(Path("lfs10d.yaml"), environment={}, host="gateway").config == before
    assert json.loads(config("--json", text=text))["config"]["mqtt"]["host"] == ["a", "b:8884", "[::1]"]


def test_the_schema_is_printed_whatever_file_there_is() -> None:
    result = CliRunner().invoke(command, ["--schema", "-c", "missing.yaml", "--merged"], catch_exceptions=False)
    assert result.exit_code == 0
    assert json.loads(result.stdout) == json_schema()


def test_a_calibration_is_one_value_as_json_has_it() -> None:
    text = "line: {port: /dev/x}\nslaves: [{id: 2, calibration: {wind_speed: {scale: 1.013}}}]\n"
    rows = {line.split()[0]: line for line in config(text=text).splitlines()}
    told = rows["slaves[0].calibration"]
    assert told.split(maxsplit=1)[1] == '{"wind_speed": {"scale": 1.013, "offset": 0.0}}  lfs10d.yaml:2'
    assert "calibration:" in config("--merged", text=text)
