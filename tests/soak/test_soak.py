"""The soak itself, short: the real daemon, a real broker, a pseudo terminal."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from soak import run as conductor
from soak.__main__ import span
from soak.plan import Act, Due, Kind, Step
from soak.report import figures
from soak.run import Soak

pytestmark = pytest.mark.long(30)

ROOT = Path(__file__).parents[2]

PLAN = [
    Step(2.5, Kind.PORT_PULLED, 0.5),
    Step(4.0, Kind.BROKER_KILLED, 1.5, (Due(4.5, Act.EAR_AWAY), Due(6.0, Act.EAR_BACK))),
    Step(6.2, Kind.RELOAD, 0.0),
    Step(7.0, Kind.DAEMON_ENDED, 0.3),
]


@pytest.mark.needs("mosquitto")
def test_a_short_soak_finds_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conductor, "steps", lambda _seed, _seconds: iter(PLAN))
    told: list[str] = []
    soak = Soak(tmp_path, 1, 8.0, told.append)
    soak.run()
    assert soak.failures == []
    assert len(told) == len(PLAN)
    counts = soak.ledger.counts
    assert counts["good"] > 200
    assert counts["bad"] > 0  # the sensors do ail
    assert soak.oracle.told_of == counts["good"]
    rows = dict(figures(soak))
    assert rows["lost"] == rows["wrong"] == rows["good answers without a sample"] == "0"
    assert len(soak.daemon.lives) == 2


@pytest.fixture
def idle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Soak]:
    """Give a soak whose daemon lies: it is a program that ends at once."""
    monkeypatch.setattr(sys, "executable", "/bin/false")
    soak = Soak(tmp_path, 1, 10.0, lambda _: None)
    yield soak
    soak.close()


@pytest.mark.needs("mosquitto")
def test_a_daemon_that_does_not_start_ends_the_soak(idle: Soak) -> None:
    with pytest.raises(RuntimeError, match="does not start"):
        idle.run()


@pytest.mark.needs("mosquitto")
def test_a_failure_is_told_with_what_repeats_it_and_keeps_the_logs(tmp_path: Path) -> None:
    """The daemon is killed behind the soak's back."""
    command = [sys.executable, "-m", "soak", "--for", "20s", "--seed", "1"]
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    soak = subprocess.Popen(
        command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert soak.stdout is not None
    for line in soak.stdout:
        if not line.startswith("seed"):
            break
    (child,) = [
        int(pid)
        for pid in Path(f"/proc/{soak.pid}/task/{soak.pid}/children").read_text().split()
        if b"lfs10d\0run" in Path(f"/proc/{pid}/cmdline").read_bytes()
    ]
    os.kill(child, signal.SIGKILL)
    _, errors = soak.communicate(timeout=60)
    assert soak.returncode == 1
    assert "exit code -9" in errors
    assert errors.rstrip().endswith("once more: python -m soak --for 20s --seed 1")
    (folder,) = tmp_path.glob("lfs10d-soak-*")
    assert (folder / "plan.txt").exists()
    assert (folder / "daemon.log").exists()


@pytest.mark.parametrize(("text", "seconds"), [("60s", 60.0), ("5m", 300.0), ("30d", 30 * 86400.0)])
def test_a_soak_lasts_from_seconds_to_a_month(text: str, seconds: float) -> None:
    assert span(text) == seconds


@pytest.mark.parametrize("text", ["5", "1s", "31d", "long"])
def test_another_length_is_refused(text: str) -> None:
    answer = subprocess.run(
        [sys.executable, "-m", "soak", "--for", text], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert answer.returncode == 2
    assert "argument --for: " in answer.stderr
