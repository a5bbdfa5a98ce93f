"""What the masters are started with."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.masters import AS_A_SERVICE

UNITS = Path(__file__).parents[2] / "systemd"


@pytest.mark.parametrize("unit", ["lfs10d.service", "lfs10d@.service"])
def test_what_is_measured_runs_in_the_environment_of_the_service(unit: str) -> None:
    said = (UNITS / unit).read_text().splitlines()
    assert AS_A_SERVICE
    assert {f"Environment={name}={value}" for name, value in AS_A_SERVICE.items()} <= set(said)
