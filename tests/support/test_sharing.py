"""Which worker gets which tests."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support import sharing

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("workers", "those"), [(1, []), (2, []), (3, [2]), (6, [5]), (8, [6, 7])])
def test_the_last_of_the_workers_computes(workers: int, those: list[int]) -> None:
    assert [number for number in range(workers + 2) if sharing.computing(number, workers)] == those


@pytest.mark.parametrize(
    ("nodeid", "waits", "piece"),
    [
        ("tests/daemon/verbs/test_watch.py::test_a[x::y/z]", True, "tests/daemon/verbs/test_watch.py::test_a[x::y/z]"),
        ("tests/web/test_page.py::test_a", True, "tests/web/test_page.py"),
        ("tests/cli/test_demo.py::test_a", True, "tests/cli/test_demo.py"),
        ("tests/line/test_pace.py::test_a", False, "tests/line/test_pace.py"),
        ("tests/test_layout.py::test_a", False, "tests/test_layout.py"),
    ],
)
def test_a_test_that_waits_goes_alone_where_it_shares_nothing(nodeid: str, waits: bool, piece: str) -> None:  # noqa: FBT001 - of a table
    assert sharing.waits(nodeid) is waits
    assert sharing.piece_of(nodeid) == piece


def test_all_tests_are_run_once_by_the_workers_of_their_kind() -> None:
    files = ["tests/cli/test_json_text.py", "tests/cli/test_direct_line.py", "tests/test_command.py"]
    run = [sys.executable, "-m", "pytest", "-v", "-p", "no:cacheprovider", *files]
    own = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    shared = [*run, "-n", "3", "--dist", "loadfile", "--no-loadscope-reorder"]
    done = subprocess.run(shared, cwd=ROOT, env=own, capture_output=True, text=True, check=True)
    told = [
        (line[:5], line.partition(" PASSED ")[2].strip()) for line in done.stdout.splitlines() if line.startswith("[gw")
    ]
    nodeids = [nodeid for _, nodeid in told]
    assert len(nodeids) == len(set(nodeids))
    assert f"== {len(nodeids)} passed in " in done.stdout
    assert {nodeid.split("::")[0] for nodeid in nodeids} == set(files)
    assert {worker for worker, nodeid in told if sharing.waits(nodeid)} <= {"[gw0]", "[gw1]"}
    assert {worker for worker, nodeid in told if not sharing.waits(nodeid)} == {"[gw2]"}
