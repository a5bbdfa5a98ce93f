"""A file that is there and may not be read is the fault of the configuration or of the machine, never wrong usage."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.needs("setpriv")

TEXT = "line: {port: /dev/null/none}\nslaves: [2]\nmqtt: {host: localhost}\n"


def unprivileged(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Call the program as somebody whom the modes of files hold back, which they do not do with root."""
    powers = "-dac_override,-dac_read_search"
    held_back = [] if os.geteuid() else ["setpriv", f"--bounding-set={powers}", f"--inh-caps={powers}"]
    command = [*held_back, sys.executable, "-m", "lfs10d", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("verb", [["run"], ["check"], ["config"], ["watch"], ["request", "health"]])
def test_an_unreadable_configuration_is_a_configuration_error(tmp_path: Path, verb: list[str]) -> None:
    file = tmp_path / "lfs10d.yaml"
    file.write_text(TEXT)
    file.chmod(0)
    done = unprivileged(*verb, "-c", str(file))
    assert (done.returncode, done.stdout, done.stderr) == (
        78, "", f"{file}:1:1: the file cannot be read: permission denied\n"
    )  # fmt: skip


def config_of_another(tmp_path: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Print the configuration where the state directory, `tmp_path`/state, may not be read."""
    file, state = tmp_path / "lfs10d.yaml", tmp_path / "state"
    file.write_text(TEXT)
    state.mkdir()
    (state / "changes.yaml").write_text("version: 1\n")
    state.chmod(0)
    try:
        return unprivileged("config", "-c", str(file), "--state-dir", str(state), *arguments)
    finally:
        state.chmod(0o700)


def test_who_may_not_read_the_state_directory_is_shown_the_file_s_part_and_told_what_is_missing(tmp_path: Path) -> None:
    """The contract's words; before, nothing was shown."""
    done = config_of_another(tmp_path)
    assert done.returncode == 1
    assert "mqtt.host" in done.stdout
    why = f"{tmp_path}/state/changes.yaml cannot be read: permission denied"
    assert done.stderr == f"lfs10d: {why}; the changes made by request are missing here: call it as root\n"
    (again := tmp_path / "again").mkdir()
    done = config_of_another(again, "--json")
    assert (done.returncode, json.loads(done.stdout)["config"]["mqtt"]["host"]) == (1, "localhost")
    assert "permission denied" in json.loads(done.stdout)["missing"]


def test_yaml_to_put_into_the_file_is_never_half_of_it(tmp_path: Path) -> None:
    done = config_of_another(tmp_path, "--merged")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"lfs10d: {tmp_path}/state/changes.yaml cannot be read: permission denied\n"
