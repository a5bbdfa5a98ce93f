"""docs/simulate.md has every kind of fault and every key of the faults file, and its example is a faults file."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pydantic import BaseModel, Field

from docs.generate import simulate
from lfs10d.simulator.fault_file import (
    FaultEntry,
    LineEntry,
    NoiseEntry,
    SecondMasterEntry,
    SlaveEntry,
    WindowEntry,
    parse_faults,
)
from lfs10d.simulator.faults import DEFAULT_DELAYS, FaultKind
from lfs10d.simulator.recorded import parse_recording
from lfs10d.simulator.wire import SECOND

PAGE = (Path(__file__).parents[2] / "docs" / "simulate.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", FaultKind)
def test_every_kind_of_fault_is_documented(kind: FaultKind) -> None:
    assert re.search(rf"^\| `{kind.value}` \| \S", PAGE, re.MULTILINE)


@pytest.mark.parametrize("kind", DEFAULT_DELAYS)
def test_every_default_delay_is_given(kind: FaultKind) -> None:
    assert re.search(rf"^\| `{kind.value}` \| `[\d.]+m?s` \|$", PAGE, re.MULTILINE)


@pytest.mark.parametrize("model", [FaultEntry, LineEntry, NoiseEntry, SecondMasterEntry, SlaveEntry, WindowEntry])
def test_every_key_of_the_faults_file_is_documented(model: type[BaseModel]) -> None:
    for name, field in model.model_fields.items():
        assert f"| `{field.alias or name}` | " in PAGE


def test_the_values_of_a_fault_are_names() -> None:
    assert re.search(r"^\| `values` \| a list of names \|", PAGE, re.MULTILINE)


def test_the_example_is_a_faults_file() -> None:
    (text,) = re.findall(r"^```yaml\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    faults = parse_faults(text, "faults.yaml", range(1, 9))
    assert faults.line.echo
    assert faults.slaves[4].faults[1].sensor_fault.rate == 0.05


def test_the_example_is_a_recording() -> None:
    (text,) = re.findall(r"^```csv\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    recording = parse_recording(text, "storm.csv", dict.fromkeys(range(1, 5), ("wind_speed",)))
    assert recording.of_slave(3)["wind_speed"](SECOND) is None
    assert recording.of_slave(1)["wind_speed"](SECOND) == 15.9


def test_a_key_without_description_is_refused() -> None:
    class Entry(BaseModel):
        key: int = Field(1)

    with pytest.raises(ValueError, match="key has no description"):
        simulate._keys(Entry)
