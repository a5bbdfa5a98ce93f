"""What the tests of the verbs share: the program as a person calls it."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING, Protocol

import pytest

if TYPE_CHECKING:
    from pathlib import Path


class Lfs10d(Protocol):
    """Calls the program with arguments, in a folder of its own, without a terminal."""

    def __call__(self, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        """Return the exit code and what was printed."""


@pytest.fixture
def lfs10d(tmp_path: Path) -> Lfs10d:
    """Return the program, to be called."""

    def call(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "lfs10d", *arguments],
            cwd=tmp_path,
            env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), **environment},
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )

    return call


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """Return a valid configuration file, in the folder the program is called in."""
    file = tmp_path / "lfs10d.yaml"
    file.write_text("line: {port: /dev/x}\nslaves: [2, {id: 3, interval: 250ms}]\nmqtt: {host: localhost}\n")
    return file
