"""A folder of its own for a configuration file."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Problems then show short names."""
    monkeypatch.chdir(tmp_path)
