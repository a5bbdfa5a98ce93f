"""What the masters are started with."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bench.masters import AS_A_SERVICE, daemon_configuration
from bench.rows import ROWS, Row
from lfs10d.config.loader import load

UNITS = Path(__file__).parents[2] / "systemd"


@pytest.mark.parametrize("unit", ["lfs10d.service", "lfs10d@.service"])
def test_what_is_measured_runs_in_the_environment_of_the_service(unit: str) -> None:
    said = (UNITS / unit).read_text().splitlines()
    assert AS_A_SERVICE
    assert {f"Environment={name}={value}" for name, value in AS_A_SERVICE.items()} <= set(said)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_the_daemon_takes_the_configuration_of_every_row(row: Row, tmp_path: Path) -> None:
    file = tmp_path / "line0.yaml"
    file.write_text(json.dumps(daemon_configuration(row, Path("/dev/null"), 1883)))
    assert len(load(file).config.slaves) == len(row.ids)
