"""`lfs10d scan` as a person calls it, on a line that a pseudo terminal plays in real time."""

from __future__ import annotations

import contextlib
import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from lfs10d.cli.render.scan_progress import span
from lfs10d.cli.scan import command
from lfs10d.config.loader import load
from lfs10d.profiles.library import load_profile
from lfs10d.simulator.blueprint import blueprint_of
from lfs10d.simulator.line_faults import stray
from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.faulty_sensors import add_fault
from tests.support.verbs import AtTerminal, Lfs10d


def wild(slave: int) -> Sensor:
    sensor = Sensor(slave)
    add_fault(sensor, "wildcard")
    return sensor


def test_a_newcomer_sees_who_is_there_and_what_to_write_down(lfs10d: Lfs10d, sensors: PtyLine, tmp_path: Path) -> None:
    for sensor in (Sensor(1), wild(2), Sensor(3), Sensor(3, seed=9), Sensor(4, format=Format(19200))):
        sensors.line.add(sensor)
    done = lfs10d("scan", sensors.path, "--ids", "1-5,255")
    assert done.returncode == 0
    table, _, snippet = done.stdout.partition("\n\n")
    head, *rows = table.splitlines()
    assert head.split() == ["id", "baud", "answers", "in", "what", "it", "is", "remark"]
    assert [row.split()[:2] for row in rows] == [
        ["1", "9600"],
        ["2", "9600"],
        ["3", "9600"],
        ["255", "9600"],
        ["4", "19200"],
    ]
    assert re.search(r"\d+ ms  LFS10 wind speed sensor, [\d.e-]+ m/s +the factory id", rows[0])
    assert "DUPLICATE?" in rows[2]
    assert "SUSPECT: probably sensor 2, which answers 255 too" in rows[3]
    file = tmp_path / "lfs10d.yaml"
    file.write_text(snippet)
    assert [slave.id for slave in load(file).config.slaves] == [1, 2]
    assert load(file).config.line.port == sensors.path
    assert "\x1b" not in done.stdout + done.stderr


def test_in_a_pipe_progress_is_plain_lines_beside_the_result(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    sensors.line.add(Sensor(2))
    done = lfs10d("scan", sensors.path, "--ids", "1-20", "--baudrate", "9600")
    first, *others = done.stderr.splitlines()
    assert first.startswith(f"Scanning {sensors.path}: 20 ids at 9600 baud, about 3 s.")
    assert others[0].startswith("found 2 at 9600 baud: LFS10 wind speed sensor")
    assert all(re.fullmatch(r"\d+ %, about \d+ s to go", line) for line in others[1:])
    assert len(others) > 3


def test_at_a_terminal_there_is_a_bar_and_a_table(at_terminal: AtTerminal, sensors: PtyLine) -> None:
    sensors.line.add(Sensor(2))
    code, seen = at_terminal("scan", sensors.path, "--ids", "1-6", "--baudrate", "9600")
    assert code == 0
    assert "9600 baud, id   2" in seen
    assert "━" in seen
    assert "to go" in seen
    assert "found 2 at 9600 baud" in seen
    table = seen.rpartition("answers in")[2]
    assert "LFS10 wind speed sensor" in table
    assert "mqtt: {host: localhost}" in table


def test_json_is_all_that_standard_output_carries(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    sensors.line.add(Sensor(2))
    sensors.line.add(wild(3))
    done = lfs10d("scan", sensors.path, "--ids", "2-3,255", "--baudrate", "9600", "--json")
    assert done.stderr == ""
    report = json.loads(done.stdout)
    assert (report["complete"], report["asked"], report["total"], report["port"]) == (True, 3, 3, sensors.path)
    assert [(each["id"], each["suspect"]) for each in report["found"]] == [(2, False), (3, False), (255, True)]
    assert report["found"][0] | {"rtt_ms": None, "values": None} == {
        "id": 2,
        "baudrate": 9600,
        "answers": True,
        "rtt_ms": None,
        "profile": "lfs10",
        "title": "LFS10 wind speed sensor",
        "alternatives": [],
        "values": None,
        "calibrated": {},
        "units": {"wind_speed": "m/s"},
        "id_register": 2,
        "exception_code": None,
        "suspect": False,
        "duplicate": False,
    }


def test_who_finds_nobody_is_told_what_to_check(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    done = lfs10d("scan", sensors.path, "--ids", "1-2")
    assert (done.returncode, done.stdout) == (1, "")
    assert "No reply: not a single byte came back." in done.stderr
    assert "Are A and B swapped?" in done.stderr


def test_json_of_nobody_is_an_empty_list(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    done = lfs10d("scan", sensors.path, "--ids", "7", "--baudrate", "19200", "--json")
    assert (done.returncode, json.loads(done.stdout)["found"], done.stderr) == (1, [], "")


def test_noise_is_told_beside_what_was_found(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    sensors.line.add(Sensor(2))
    stray(sensors.line)
    done = lfs10d("scan", sensors.path, "--ids", "1-8", "--baudrate", "9600")
    assert done.returncode == 0
    assert "At 7 of 8 ids bytes were received that are no valid reply" in done.stderr
    assert "What to check" not in done.stderr


def test_a_profile_of_ones_own_is_recognised(lfs10d: Lfs10d, sensors: PtyLine, tmp_path: Path) -> None:
    sensors.line.add(Sensor(2))
    profile = tmp_path / "rate.yaml"
    profile.write_text("name: rate\ntitle: Rate teller\nvalues: [{name: code, register: 4, type: uint16, unit: '1'}]\n")
    done = lfs10d("scan", sensors.path, "--ids", "2", "--baudrate", "9600", "--profile", str(profile))
    assert "Rate teller, 1" in done.stdout
    assert f'{{id: 2, profile: "{profile}"}}' in done.stdout


def test_ascii_is_spoken_where_it_is_asked_for(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    done = lfs10d("scan", sensors.path, "--ids", "2", "--baudrate", "9600", "--framing", "ascii")
    assert done.returncode == 1


@contextlib.contextmanager
def scanning(sensors: PtyLine) -> Iterator[subprocess.Popen[str]]:
    """Give a scan of all ids that has found the one sensor there is."""
    sensors.line.add(Sensor(1))
    with subprocess.Popen(
        [sys.executable, "-m", "lfs10d", "scan", sensors.path],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={"PATH": "/usr/bin:/bin"},
    ) as process:
        assert process.stderr is not None
        while not process.stderr.readline().startswith("found 1"):
            assert process.poll() is None
        yield process


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_who_ends_it_sees_what_was_found_so_far(sensors: PtyLine, number: signal.Signals) -> None:
    with scanning(sensors) as process:
        begun = time.monotonic()
        process.send_signal(number)
        out, err = process.communicate(timeout=10)
        assert time.monotonic() - begun < 2
    assert process.returncode == 1
    assert "of 510 ids; found so far:" in err
    assert "LFS10 wind speed sensor" in out


def test_an_adapter_pulled_out_ends_it_with_what_was_found(sensors: PtyLine) -> None:
    with scanning(sensors) as process:
        sensors.stop()
        out, err = process.communicate(timeout=10)
    assert process.returncode == 69
    assert "hung up" in err
    assert "LFS10 wind speed sensor" in out


@pytest.mark.parametrize("option", [[], ["--json"]])
def test_a_port_that_is_not_there_is_69(lfs10d: Lfs10d, option: list[str]) -> None:
    done = lfs10d("scan", "/dev/ttyNOPE", *option)
    assert (done.returncode, done.stdout) == (69, "")
    assert done.stderr.startswith("lfs10d: /dev/ttyNOPE: there is no such device")
    assert len(done.stderr.splitlines()) == 1


def test_a_busy_port_is_69_and_says_what_the_daemon_does_instead(sensors: PtyLine, lfs10d: Lfs10d) -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "lfs10d", "scan", sensors.path],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={"PATH": "/usr/bin:/bin"},
    ) as other:
        assert other.stderr is not None
        assert other.stderr.readline().startswith("Scanning")
        done = lfs10d("scan", sensors.path)
        other.terminate()
        other.communicate(timeout=10)
    assert (done.returncode, done.stdout) == (69, "")
    assert f"in use by lfs10d (process {other.pid})" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--ids", "0-5"], "ids go from 1 to 255"),
        (["--ids", "x"], "neither an id such as 3"),
        (["--baudrate", "9600,1234"], "'1234' is not one of 1200"),
        (["--databits", "7"], "rtu frames need 8 data bits"),
        (["--timeout", "soon"], "is not a duration"),
        (["--timeout", "1m"], "from 10ms to 10s"),
    ],
)
def test_what_cannot_be_meant_is_a_usage_error(arguments: list[str], complaint: str) -> None:
    result = CliRunner().invoke(command, ["/dev/x", *arguments])
    assert result.exit_code == 2
    assert complaint in result.output


@pytest.mark.parametrize(("seconds", "text"), [(0.2, "1 s"), (59.4, "59 s"), (60, "1 min"), (95, "1 min 35 s")])
def test_durations_are_told_as_people_do(seconds: float, text: str) -> None:
    assert span(seconds) == text


def test_what_was_found_is_written_to_a_new_file_that_is_valid(
    lfs10d: Lfs10d, sensors: PtyLine, tmp_path: Path
) -> None:
    sensors.line.add(Sensor(2))
    done = lfs10d("scan", sensors.path, "--ids", "1-3", "--baudrate", "9600", "--write", "site.yaml")
    assert done.returncode == 0
    assert "site.yaml written. Look at it, then: lfs10d check -c site.yaml" in done.stderr
    assert f"port: {sensors.path}" in (tmp_path / "site.yaml").read_text()
    assert lfs10d("check", "-c", "site.yaml").returncode == 0
    again = lfs10d("scan", sensors.path, "--ids", "1-3", "--baudrate", "9600", "--write", "site.yaml")
    assert (again.returncode, "exists already" in again.stderr) == (2, True)


def test_an_included_profile_that_is_named_is_not_its_own_alternative(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    renke = load_profile("renke-rs-fsjt", relative_to=Path())
    sensors.line.add(Sensor(2, blueprint=blueprint_of(renke)))
    done = lfs10d("scan", sensors.path, "--ids", "2", "--baudrate", "9600", "--profile", renke.name, "--json")
    (found,) = json.loads(done.stdout)["found"]
    assert (found["profile"], found["alternatives"]) == (renke.name, ["pr-3000-fsjt"])
