"""A file that is there and may not be read is the fault of the configuration or of the machine, never wrong usage."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

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


@pytest.mark.parametrize("arguments", [[], ["--merged"], ["--json"]])
def test_a_state_directory_that_may_not_be_read_is_told_with_exit_code_1(tmp_path: Path, arguments: list[str]) -> None:
    file, state = tmp_path / "lfs10d.yaml", tmp_path / "state"
    file.write_text(TEXT)
    state.mkdir()
    (state / "changes.yaml").write_text("version: 1\n")
    state.chmod(0)
    try:
        done = unprivileged("config", "-c", str(file), "--state-dir", str(state), *arguments)
    finally:
        state.chmod(0o700)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"lfs10d: {state}/changes.yaml cannot be read: permission denied\n"
