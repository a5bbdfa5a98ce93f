"""`lfs10d simulate` as a person calls it."""

from __future__ import annotations

import json
import os
import select
import signal
import struct
import subprocess
import sys
import termios
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from lfs10d.simulator.wire import seal, unseal
from tests.support.verbs import Lfs10d


@contextmanager
def simulating(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run the verb; yield it and its first line."""
    with subprocess.Popen(
        [sys.executable, "-m", "lfs10d", "simulate", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    ) as process:
        try:
            assert process.stdout is not None
            yield process, process.stdout.readline()
        finally:
            process.kill()


def exchange(path: str, body: bytes, size: int) -> bytes | None:
    """Return the body of what a plain master hears, None if nobody answers within 0.3 s."""
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY)
    try:
        tty.setraw(descriptor)
        attributes = termios.tcgetattr(descriptor)
        attributes[4] = attributes[5] = termios.B9600
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
        time.sleep(0.0037)
        os.write(descriptor, seal(body))
        frame = b""
        while len(frame) < size and select.select([descriptor], [], [], 0.3)[0]:
            frame += os.read(descriptor, 16)
    finally:
        os.close(descriptor)
    return unseal(frame)


def registers(path: str, slave: int, address: int, count: int = 1) -> list[int] | None:
    """Return what holding registers hold, None if nobody answers."""
    body = exchange(path, struct.pack(">BBHH", slave, 3, address, count), 5 + 2 * count)
    return None if body is None else list(struct.unpack(f">{count}H", body[3:]))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_serves_by_its_link_and_ends_cleanly(tmp_path: Path, number: signal.Signals) -> None:
    link = tmp_path / "line0"
    with simulating("--link", str(link), "--slaves", "1-3,255") as (process, first):
        assert first == f"simulated line at {link}: 4 sensors, 9600 baud, rtu; Ctrl-C ends it\n"
        assert registers(str(link), 255, 5) == [255]
        assert registers(str(link), 4, 5) is None
        begun = time.monotonic()
        process.send_signal(number)
        rest, errors = process.communicate(timeout=10)
        assert time.monotonic() - begun < 2
        assert process.returncode == 0
    assert errors == ""
    assert " 2 requests, 2 heard, 1 answers, 0 begun too early, 0 torn" in rest
    assert not link.is_symlink()


def test_with_json_the_first_line_tells_the_path_and_the_last_the_figures() -> None:
    with simulating("--json", "--interval", "50ms") as (process, first):
        ready: dict[str, Any] = json.loads(first)
        assert ready["event"] == "ready"
        assert registers(ready["path"], 8, 5) == [8]
        process.terminate()
        rest, _ = process.communicate(timeout=10)
    figures = [json.loads(line) for line in rest.splitlines()]
    assert [one["event"] for one in figures] == ["figures"] * (len(figures) - 1) + ["end"]
    assert (figures[-1]["requests"], figures[-1]["heard"], figures[-1]["gap_violations"]) == (1, 1, 0)


def test_faults_come_from_a_file(tmp_path: Path) -> None:
    faults = tmp_path / "faults.yaml"
    faults.write_text("slaves: {3: silent}\n", "utf-8")
    with simulating("--json", "--faults", str(faults)) as (_, first):
        path = json.loads(first)["path"]
        assert registers(path, 3, 5) is None
        assert registers(path, 2, 5) == [2]


def test_recorded_wind_comes_from_a_file(tmp_path: Path) -> None:
    wind = tmp_path / "wind.csv"
    wind.write_text("time,wind_speed,2.wind_speed\n0,12.99,4.5\n", "utf-8")
    with simulating("--json", "--slaves", "1-2", "--wind", str(wind)) as (_, first):
        path = json.loads(first)["path"]
        assert [registers(path, slave, 1, 2) for slave in (1, 2)] == [[0x414F, 0xD70A], [0x4090, 0x0000]]


def test_another_device_is_played_by_its_profile() -> None:
    with simulating("--json", "--profile", "ld-e", "--slaves", "9") as (_, first):
        words = registers(json.loads(first)["path"], 9, 0x1004, 2)
    assert words is not None
    assert words[1] == 0


def test_a_power_cycle_can_be_asked_for_by_signal(tmp_path: Path) -> None:
    faults = tmp_path / "faults.yaml"
    faults.write_text("all: power_cycle\n", "utf-8")
    with simulating("--json", "--slaves", "1", "--faults", str(faults)) as (process, first):
        path = json.loads(first)["path"]
        new_id = bytes.fromhex("010600050009")
        assert exchange(path, new_id, 8) == new_id
        assert registers(path, 9, 5) is None
        process.send_signal(signal.SIGUSR1)
        end = time.monotonic() + 5
        while (found := registers(path, 9, 5)) is None and time.monotonic() < end:
            pass
        assert found == [9]


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("--faults", "none.yaml"), 78, "none.yaml:1:1: cannot be read: No such file or directory"),
        (("--wind", "none.csv"), 78, "none.csv:1:1: cannot be read: No such file or directory"),
        (("--slaves", "0"), 2, "'0': ids go from 1 to 255, the smaller first"),
        (("--turnaround", "soon"), 2, "'soon' is not a duration; write 5ms, 1s or 2m"),
        (("--link", "none/line0"), 1, "none/line0: the link cannot be made: No such file or directory"),
    ],
)
def test_a_mistake_is_told_in_one_line(lfs10d: Lfs10d, arguments: tuple[str, ...], code: int, message: str) -> None:
    result = lfs10d("simulate", *arguments)
    assert (result.returncode, result.stdout) == (code, "")
    assert result.stderr.splitlines()[-1].endswith(message)


def test_the_help_shows_a_faults_file(lfs10d: Lfs10d) -> None:
    shown = lfs10d("simulate", "--help").stdout
    assert "3: silent" in shown
    assert Path("/tmp/line0").name in shown  # noqa: S108  # a name in an example
