"""`lfs10d read` as a person calls it, on a line that a pseudo terminal plays in real time."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from lfs10d.cli.options import take
from lfs10d.cli.read import _Attempts, _explanation, _ReadOptions, command
from lfs10d.profiles.library import load_profile
from lfs10d.reading import Exchanged, Fault, FaultCode, Purpose
from lfs10d.simulator.blueprint import LFS10, blueprint_of
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.signals import Signal
from lfs10d.simulator.wire import Format
from tests.support.faulty_sensors import add_fault
from tests.support.verbs import AtTerminal, Lfs10d


def watching(sensors: PtyLine, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "lfs10d", "read", sensors.path, "2", "--watch", "--interval", "100ms", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={"PATH": "/usr/bin:/bin"},
    )


def test_one_sensor_is_read_now(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    sensors.line.add(Sensor(2))
    done = lfs10d("read", sensors.path, "2")
    assert (done.returncode, done.stderr) == (0, "")
    title, value, answered = done.stdout.splitlines()
    assert title == "Slave 2 answers: LFS10 wind speed sensor"
    assert re.fullmatch(r"  wind_speed   [\d.e-]+ m/s", value)
    assert re.fullmatch(r"  answered in  [\d.]+ ms", answered)


def test_json_is_a_sample_for_programs(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    sensors.line.add(Sensor(2))
    done = lfs10d("read", sensors.path, "2", "--json")
    sample = json.loads(done.stdout)
    assert abs(sample["ts"] / 1000 - time.time()) < 60
    assert 0 <= sample["wind_speed"] <= 100
    assert sample["rtt_ms"] > 15
    assert (sample["quality"], sample["error"], sample["unit"], sample["slave"]) == ("good", None, "m/s", 2)


def test_a_calibrated_slave_is_shown_raw_and_calibrated(lfs10d: Lfs10d, sensors: PtyLine, tmp_path: Path) -> None:
    sensors.line.add(Sensor(2, source=lambda _: 12.99))
    (tmp_path / "own.yaml").write_text(
        f"line: {{port: {sensors.path}}}\nmqtt: {{host: localhost}}\n"
        "slaves: [{id: 2, calibration: {wind_speed: {scale: 1.0137, offset: 0.061}}}]\n"
    )
    done = lfs10d("read", sensors.path, "2", "-c", "own.yaml")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[1] == "  wind_speed   12.99 m/s, calibrated 13.22896 m/s"
    sample = json.loads(lfs10d("read", sensors.path, "2", "--json", LFS10D_CONFIG="own.yaml").stdout)
    assert (sample["wind_speed"], sample["calibrated"]) == (12.99, {"wind_speed": 13.22896})
    report = json.loads(
        lfs10d("scan", sensors.path, "--ids=2", "--baudrate=9600", "--json", "--config=own.yaml").stdout
    )
    (found,) = report["found"]
    assert (found["values"], found["calibrated"]) == ({"wind_speed": 12.99}, {"wind_speed": 13.22896})
    table = lfs10d("scan", sensors.path, "--ids=2", "--baudrate=9600", "-c", "own.yaml").stdout
    assert "LFS10 wind speed sensor, 12.99 m/s, calibrated 13.22896 m/s" in table


@pytest.mark.parametrize(
    ("raw", "scale", "shown"), [(105.0, 0.9, "wind_speed   105.0 m/s, calibrated 94.5 m/s"), (99.5, 1.013, None)]
)
def test_the_range_is_that_of_the_calibrated_value(
    lfs10d: Lfs10d, sensors: PtyLine, tmp_path: Path, raw: float, scale: float, shown: str | None
) -> None:
    """As the daemon judges it (docs/configuration.md): 105 m/s raw are 94.5 m/s, and 99.5 m/s raw more than 100."""
    wide = replace(LFS10, signals=(Signal(1, name="wind_speed", low=0, high=200),))
    sensors.line.add(Sensor(2, blueprint=wide, source=lambda _: raw))
    (tmp_path / "own.yaml").write_text(
        f"line: {{port: {sensors.path}}}\nmqtt: {{host: localhost}}\n"
        f"slaves: [{{id: 2, name: top, calibration: {{wind_speed: {{scale: {scale}}}}}}}]\n"
    )
    done = lfs10d("read", sensors.path, "2", "-c", "own.yaml")
    scanned = lfs10d("scan", sensors.path, "--ids=2", "--baudrate=9600", "-c", "own.yaml", "--write", "new.yaml").stdout
    if shown is None:
        assert done.returncode == 1
        assert "wind_speed 100.7935 m/s is outside 0..100 m/s" in done.stderr
        assert "unknown device" in scanned
        return
    assert done.returncode == 0, done.stderr
    assert shown in done.stdout
    assert "LFS10 wind speed sensor, 105.0 m/s, calibrated 94.5 m/s" in scanned
    assert (
        "{id: 2, name: top, calibration: {wind_speed: {scale: 0.9, offset: 0.0}}}"
        in (tmp_path / "new.yaml").read_text()
    )


def test_another_device_at_another_rate_is_read_by_its_profile(
    lfs10d: Lfs10d, sensors: PtyLine, tmp_path: Path
) -> None:
    profile = load_profile("fuling-dzb", relative_to=tmp_path)
    sensors.line.add(Sensor(7, blueprint=blueprint_of(profile), format=Format(19200)))
    done = lfs10d("read", sensors.path, "7", "--profile", "fuling-dzb", "--baudrate", "19200")
    assert done.returncode == 0
    assert [line.split()[0] for line in done.stdout.splitlines()[1:-1]] == list(profile.value_names)
    done = lfs10d("read", sensors.path, "7", "--profile", "fuling-dzb", "--baudrate", "19200", "--json")
    assert json.loads(done.stdout)["units"]["speed"] == "rpm"


def test_silence_is_shown_and_explained(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    done = lfs10d("read", sensors.path, "9")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(
        "lfs10d: no value from slave 9 at 9600 baud 8N1 after 3 attempts: no answer in 1000 ms"
    )
    assert "09 03 00 01 00 02 94 83  read 2 registers at 0x0001 of slave 9" in done.stderr
    assert "received  nothing" in done.stderr
    assert "No reply: not a single byte came back." in done.stderr
    assert f"`lfs10d scan {sensors.path}` tries them all; or try --baudrate 19200" in done.stderr


def test_a_sensor_that_answers_at_the_second_attempt_is_read(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    sensors.line.add(Sensor(2, turnaround=0.3))
    assert lfs10d("read", sensors.path, "2").returncode == 0


def test_garbled_answers_are_shown_in_hex_and_explained(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    add_fault(sensors.line.add(Sensor(3)), "noisy")
    done = lfs10d("read", sensors.path, "3")
    assert done.returncode == 1
    assert "A reply of the right length came, but its checksum is wrong." in done.stderr
    assert "Do two sensors share this id?" in done.stderr
    assert len(re.findall(r"received  (?:[0-9A-F]{2} ){6,8}[0-9A-F]{2}", done.stderr)) == 3


def test_a_refusal_is_explained_at_once(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    add_fault(sensors.line.add(Sensor(3)), "exception")
    done = lfs10d("read", sensors.path, "3")
    assert done.returncode == 1
    assert "after 1 attempt: exception 02 illegal register address" in done.stderr
    assert "The device is there and understood the request, but refuses it." in done.stderr


def test_a_busy_device_is_asked_again(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    add_fault(sensors.line.add(Sensor(3)), "exception", code=6)
    assert "after 3 attempts: exception 06 busy" in lfs10d("read", sensors.path, "3").stderr


def test_an_echoing_adapter_is_told(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    sensors.adapter.echo = True
    done = lfs10d("read", sensors.path, "9")
    assert "Only the request itself came back: the adapter echoes" in done.stderr


def test_a_line_on_which_nothing_could_be_sent_is_told() -> None:
    line = take(
        {**dict.fromkeys(("databits", "timeout")), "port": "/dev/x", "framing": "rtu", "parity": "odd", "stopbits": "2"}
    )
    profile = load_profile("lfs10", relative_to=Path())
    wanted = _ReadOptions(line, 9, profile, 9600, checksum=None, watch=False, interval=1.0, as_json=False)
    babble = Exchanged(0.2, 0.0, None, None, 9, Purpose.POLL, FaultCode.COLLISION, b"", bytes(40), 40)
    told = list(_explanation(wanted, _Attempts([babble], 3), Fault(FaultCode.COLLISION, "no silence"), None))
    assert told[0] == "lfs10d: no value from slave 9 at 9600 baud 8O2 after 3 attempts: no silence"
    assert told[2].split() == ["sent", "nothing"]
    assert told[3].split()[:2] == ["received", "00"]
    assert "Another device transmits on the line." in told
    assert any("second master" in text for text in told)


def test_json_of_a_failure_says_why_and_nothing_else_is_printed(lfs10d: Lfs10d, sensors: PtyLine) -> None:
    done = lfs10d("read", sensors.path, "9", "--json", "--timeout", "50ms")
    sample = json.loads(done.stdout)
    assert (done.returncode, done.stderr) == (1, "")
    assert (sample["wind_speed"], sample["quality"], sample["error"], sample["rtt_ms"]) == (
        None,
        "bad",
        "timeout",
        None,
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_watch_reads_until_it_is_ended(sensors: PtyLine, number: signal.Signals) -> None:
    sensors.line.add(Sensor(2))
    with watching(sensors) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(3)]
        begun = time.monotonic()
        process.send_signal(number)
        _, err = process.communicate(timeout=10)
        assert time.monotonic() - begun < 2
    assert (process.returncode, err) == (0, "")
    for line in lines:
        assert re.fullmatch(r"20\d\d-\d\d-\d\d [\d:]{8}\.\d{3} \S+  wind_speed [\d.e-]+ m/s +[\d.]+ ms\n", line)


def test_watch_as_json_is_a_line_per_reading(sensors: PtyLine) -> None:
    sensors.line.add(Sensor(2))
    with watching(sensors, "--json") as process:
        assert process.stdout is not None
        samples = [json.loads(process.stdout.readline()) for _ in range(2)]
        process.terminate()
        process.communicate(timeout=10)
    assert [sample["quality"] for sample in samples] == ["good", "good"]


def appear(line: SimulatedLine) -> None:
    line.add(Sensor(2))


def test_watch_goes_on_through_silence_and_explains_it_once(sensors: PtyLine) -> None:
    with watching(sensors, "--timeout", "50ms") as process:
        assert process.stdout is not None
        failures = [process.stdout.readline() for _ in range(3)]
        sensors.tell(appear)
        while "wind_speed" not in process.stdout.readline():
            assert process.poll() is None
        process.terminate()
        _, err = process.communicate(timeout=10)
    assert process.returncode == 0
    assert all("timeout: no answer in 50 ms" in line for line in failures)
    assert err.count("What to check:") == 1


def test_watch_at_a_terminal_draws_the_wind(at_terminal: AtTerminal, sensors: PtyLine) -> None:
    sensors.line.add(Sensor(2))
    code, seen = at_terminal("read", sensors.path, "2", "--watch", "--interval", "100ms", columns=100, until="━")
    assert code == 0
    assert "━" in seen
    assert "m/s" in seen


def test_an_adapter_pulled_out_ends_the_watch_with_69(sensors: PtyLine) -> None:
    sensors.line.add(Sensor(2))
    with watching(sensors) as process:
        assert process.stdout is not None
        process.stdout.readline()
        sensors.stop()
        _, err = process.communicate(timeout=10)
    assert process.returncode == 69
    assert "hung up" in err
    assert "Traceback" not in err


def test_a_port_that_is_not_there_is_69(lfs10d: Lfs10d) -> None:
    done = lfs10d("read", "/dev/ttyNOPE", "1")
    assert (done.returncode, done.stdout) == (69, "")
    assert done.stderr.startswith("lfs10d: /dev/ttyNOPE: there is no such device")


def test_a_port_held_by_the_daemon_is_69_and_says_what_to_type(
    lfs10d: Lfs10d, sensors: PtyLine, tmp_path: Path
) -> None:
    file = tmp_path / "site.yaml"
    file.write_text(
        f"line: {{port: {sensors.path}}}\nslaves: [{{id: 2, name: mast-top}}]\nmqtt: {{host: 127.0.0.1, port: 1}}\n"
    )
    with subprocess.Popen(
        [sys.executable, "-m", "lfs10d", "run", "-c", str(file), "--state-dir", str(tmp_path / "state")],
        stderr=subprocess.PIPE,
        text=True,
        env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)},
    ) as daemon:
        try:
            assert daemon.stderr is not None
            while "is open" not in daemon.stderr.readline():
                assert daemon.poll() is None
            done = lfs10d("read", sensors.path, "2")
        finally:
            daemon.terminate()
        daemon.communicate(timeout=10)
    assert (done.returncode, done.stdout) == (69, "")
    assert f"in use by lfs10d (process {daemon.pid})" in done.stderr
    assert f"lfs10d request device/read device=mast-top -c {file}" in done.stderr
    assert f"lfs10d watch -c {file}" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["0"], "0 is not in the range"),
        (["256"], "256 is not in the range"),
        (["x"], "not a valid slave id"),
        ([], "Missing argument 'ID'"),
        (["2", "--baudrate", "9601"], "'9601' is not one of 1200"),
        (["2", "--interval", "often"], "is not a duration"),
        (["2", "--interval", "1ms"], "must be 50ms or more"),
        (["2", "--framing", "ascii"], "profile lfs10 does not support ascii"),
        (["250", "--profile", "ld-e"], "profile ld-e has ids 1 to 247, not 250"),
    ],
)
def test_what_cannot_be_meant_is_a_usage_error(arguments: list[str], complaint: str) -> None:
    result = CliRunner().invoke(command, ["/dev/x", *arguments])
    assert result.exit_code == 2
    assert complaint in result.output


def test_a_profile_that_does_not_exist_is_78(lfs10d: Lfs10d) -> None:
    done = lfs10d("read", "/dev/ttyNOPE", "2", "--profile", "nope.yaml")
    assert done.returncode == 78
    assert "nope.yaml" in done.stderr
