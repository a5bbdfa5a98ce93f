"""The C reference keeps the line's rules, so that what it reaches is what can be reached."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

from bench.line import PacedLine
from bench.programs import build_reference
from bench.rows import Row

pytestmark = pytest.mark.needs("gcc")


def polled(line: PacedLine, *options: str) -> dict[str, Any]:
    """Let the reference poll for a second and a half; return what it counted."""
    words = [str(build_reference()), "--seconds", "1.5", *options, str(line.port)]
    finished = subprocess.run(words, capture_output=True, text=True, check=True, timeout=30)
    counts: dict[str, Any] = json.loads(finished.stdout)
    return counts


@pytest.mark.parametrize("baudrate", [9600, 115200])
def test_it_is_always_heard_and_always_answered(tmp_path: Path, baudrate: int) -> None:
    with PacedLine(tmp_path, "--baudrate", str(baudrate), "--turnaround", "1") as line:
        mine = polled(line, "--baudrate", str(baudrate))
        counts = line.close()
    assert mine["good"] == mine["polls"] == counts["answered"]
    assert (counts["too_early"], counts["pauses"], counts["bad_frames"], counts["wrong_rate"]) == (0, 0, 0, 0)
    assert 0.2 < counts["answers_per_s"] / Row("", "", baudrate=baudrate).limit <= 1.0


def test_it_gives_up_a_dead_sensor_and_polls_on(tmp_path: Path) -> None:
    with PacedLine(tmp_path, "--baudrate", "19200", "--sensors", "3", "--dead", "2") as line:
        mine = polled(line, "--baudrate", "19200", "--ids", "1-3", "--timeout", "200")
        counts = line.close()
    assert mine["timeouts"] == counts["unanswered"] > 0
    assert mine["good"] == counts["answered"] > 0
    assert counts["too_early"] == 0


def test_it_takes_spoilt_answers_for_broken(tmp_path: Path) -> None:
    with PacedLine(tmp_path, "--baudrate", "19200", "--sensors", "3", "--noise", "100") as line:
        mine = polled(line, "--baudrate", "19200", "--ids", "1-3")
    assert mine["broken"] > 0
    assert mine["good"] == 0
