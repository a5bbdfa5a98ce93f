"""A paced line at 1200 baud, where a busy machine cannot blur what is early and what is late."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bench.line import PacedLine
from tests.support.terminals import BAUDRATE


@pytest.fixture
def paced(tmp_path: Path) -> Iterator[Callable[..., PacedLine]]:
    """Give a starter of paced lines at 1200 baud with three sensors."""
    lines = []

    def start(*options: str) -> PacedLine:
        words = ("--baudrate", str(BAUDRATE), "--sensors", "3", "--turnaround", "1", *options)
        lines.append(PacedLine(tmp_path, *words))
        return lines[-1]

    yield start
    for line in lines:
        line.__exit__()
