"""The faults file: what it says, and where it is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.errors import ConfigError
from lfs10d.simulator.fault_file import FaultFile, load_faults, parse_faults
from lfs10d.simulator.faults import FaultKind, SensorFault
from tests.support.faulty_sensors import sensor_fault

LATE, TWIN = FaultKind.LATE, FaultKind.TWIN


def problems(text: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        parse_faults(text, "f.yaml", range(1, 9))
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("slaves: {3: silent}", (sensor_fault("silent"),)),
        ("slaves: {3: [silent, nan]}", (sensor_fault("silent"), sensor_fault("nan"))),
        ("slaves: {3: [late, twin]}", (SensorFault(LATE, delay=600_000_000), SensorFault(TWIN, delay=37_000_000))),
        ("slaves: {3: {fault: late, delay: 700ms, rate: 0.1}}", (sensor_fault("late", 0.1, delay=0.7),)),
        ("slaves: {3: {faults: [{fault: exception, code: 6}]}}", (sensor_fault("exception", code=6),)),
        (
            "slaves: {3: {faults: {fault: silent, after: 10s, for: 5s, every: 1m}}}",
            (sensor_fault("silent", first=10, last=15, every=60),),
        ),
        (
            "slaves: {3: [{fault: dip_locked, answer: exception, reads: new}, {fault: wrong_id, id: 7}]}",
            (sensor_fault("dip_locked", answer="exception", reads="new"), sensor_fault("wrong_id", value=7)),
        ),
        ("slaves: {3: {fault: garbage, bytes: 12}}", (sensor_fault("garbage", length=12),)),
    ],
)
def test_faults_can_be_written_short_or_long(text: str, expected: tuple[object, ...]) -> None:
    faults = parse_faults(text, "f.yaml", [3])
    assert tuple(fault.sensor_fault for fault in faults.slaves[3].faults) == expected


@pytest.mark.parametrize("kind", list(FaultKind))
def test_every_kind_can_be_named(kind: FaultKind) -> None:
    (fault,) = parse_faults(f"all: {kind}", "f.yaml", []).all
    assert fault.sensor_fault.kind is kind


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("slaves: {9: silent}", "f.yaml:1:10: slaves.9: is not on this line; see --slaves"),
        ("slaves:\n  3: {coppies: 2}", "f.yaml:2:7: slaves.3.coppies: is not a known key; did you mean copies?"),
        ("line: {echo: on}", 'f.yaml:1:14: line.echo: must be true or false, not text "on"'),
        ("slaves: {3: {copies: 9}}", "f.yaml:1:22: slaves.3.copies: must be a whole number from 1 to 8, not 9"),
        ("all: [{fault: nan, rate: 2}]", "f.yaml:1:26: all[0].rate: must be at most 1.0, not 2"),
        (
            "line: {babble: [{every: 2s}]}",
            "f.yaml:1:17: line.babble[0]: `every` repeats what ends: give `for`, shorter than `every`",
        ),
        (
            "line: {babble: [{for: 2s, every: 2s}]}",
            "f.yaml:1:17: line.babble[0]: `every` repeats what ends: give `for`, shorter than `every`",
        ),
        ("slaves: {3: silent, 3: nan}", "f.yaml:1:21: slaves.3: is given twice, first in line 1; keep one"),
    ],
)
def test_a_mistake_is_told_with_its_place(text: str, problem: str) -> None:
    assert problem in problems(text)


def test_a_misspelt_fault_is_answered_with_all_there_are() -> None:
    (problem,) = problems("slaves:\n  3: silnt\n")
    assert problem.startswith("f.yaml:2:6: slaves.3")
    assert "silent, shy" in problem


def test_all_mistakes_are_told_in_their_order() -> None:
    assert len(problems("line: {echo: 1}\nslaves:\n  3: silnt\n  4: {turnaround: -1}\n")) == 3


def test_a_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "faults.yaml"
    path.write_text("line: {latency: 16ms}\n", "utf-8")
    assert load_faults(path, []).line.latency == 0.016


def test_a_file_that_is_not_there_is_an_error_for_the_person(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read: No such file"):
        load_faults(tmp_path / "faults.yaml", [])


def test_an_empty_mapping_ails_nobody() -> None:
    assert parse_faults("{}", "f.yaml", []) == FaultFile()
