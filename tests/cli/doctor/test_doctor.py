"""`lfs10d doctor` and `check --online` as a person calls them, on a simulated line without a daemon."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from lfs10d.cli.doctor import rounds
from lfs10d.simulator.pty import PtyLine
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.brokers import Mosquitto
from tests.support.verbs import Lfs10d


def configured(folder: Path, port: str, broker: int, slaves: str) -> None:
    (folder / "site.yaml").write_text(
        f"line: {{port: {port}}}\nslaves: {slaves}\nmqtt: {{host: localhost, port: {broker}}}\n"
    )


@pytest.mark.needs("mosquitto")
def test_without_a_daemon_it_asks_the_sensors_themselves(
    lfs10d: Lfs10d, sensors: PtyLine, mosquitto: Mosquitto, tmp_path: Path
) -> None:
    sensors.line.add(Sensor(2))
    configured(tmp_path, sensors.path, mosquitto.port, "[2, 7]")
    done = lfs10d("doctor", "-c", "site.yaml")
    assert done.returncode == 1
    assert "fail  sensor        slave-7 (slave id 7): timeout: no answer" in done.stdout
    assert "ok    sensors       1 of 2 reply well (read now; no daemon runs)" in done.stdout
    assert done.stdout.splitlines()[-1].startswith("1 failed, ")


@pytest.mark.needs("mosquitto")
def test_where_a_daemon_was_and_is_no_more_it_says_so_and_asks_the_sensors(
    lfs10d: Lfs10d, sensors: PtyLine, mosquitto: Mosquitto, tmp_path: Path
) -> None:
    sensors.line.add(Sensor(2))
    configured(tmp_path, sensors.path, mosquitto.port, "[2, 7]")
    mosquitto.publish("lfs10d/site/availability", "offline", retain=True)
    mosquitto.publish("lfs10d/site/devices", '[{"name": "slave-2", "id": 2}]', retain=True)
    lines = lfs10d("doctor", "-c", "site.yaml").stdout.splitlines()
    where = next(place for place, line in enumerate(lines) if line.startswith("fail  daemon        NOT LIVE: "))
    assert lines[where + 1].endswith("-> start it: lfs10d run -c site.yaml")
    assert lines[where + 2].startswith("fail  sensor        slave-7 (slave id 7): timeout: no answer")
    assert "ok    sensors       1 of 2 reply well (read now; no daemon runs)" in lines


@pytest.mark.needs("mosquitto")
def test_sensors_at_another_rate_are_found_and_the_cure_is_a_line_of_the_file(
    lfs10d: Lfs10d, sensors: PtyLine, mosquitto: Mosquitto, tmp_path: Path
) -> None:
    sensors.line.add(Sensor(2, format=Format(19200)))
    configured(tmp_path, sensors.path, mosquitto.port, "[2]")
    done = lfs10d("doctor", "-c", "site.yaml", "--json")
    advice = [each["advice"] for each in json.loads(done.stdout) if "19200" in each["text"]]
    assert advice == ["set line.baudrate to 19200; then lfs10d request line/baudrate can move them"]


@pytest.mark.needs("mosquitto")
def test_a_sensor_slower_than_the_first_time_limit_is_found(
    lfs10d: Lfs10d, sensors: PtyLine, mosquitto: Mosquitto, tmp_path: Path
) -> None:
    sensors.line.add(Sensor(2))
    sensors.line.add(Sensor(3, turnaround=0.3))
    configured(tmp_path, sensors.path, mosquitto.port, "[2, 3]")
    done = lfs10d("doctor", "-c", "site.yaml")
    assert "ok    sensors       2 of 2 reply well (read now; no daemon runs)" in done.stdout
    assert f"asking 2 sensors on {sensors.path}" in done.stderr


@pytest.mark.needs("mosquitto")
def test_the_disk_that_is_looked_at_is_that_of_the_state_directory_named(
    lfs10d: Lfs10d, sensors: PtyLine, mosquitto: Mosquitto, tmp_path: Path
) -> None:
    sensors.line.add(Sensor(2))
    configured(tmp_path, sensors.path, mosquitto.port, "[2]")
    (tmp_path / "elsewhere").mkdir()
    done = lfs10d("doctor", "-c", "site.yaml", "--state-dir", "elsewhere")
    assert f"ok    disk          {tmp_path}/elsewhere can be written" in done.stdout


def test_a_broken_file_is_a_finding_and_the_rest_is_looked_at(lfs10d: Lfs10d, tmp_path: Path) -> None:
    (tmp_path / "site.yaml").write_text("line: 7\n")
    done = lfs10d("doctor", "-c", "site.yaml")
    assert done.returncode == 1
    assert "site.yaml:1:7: line: " in done.stdout
    assert "clock " in done.stdout


@pytest.mark.needs("mosquitto")
def test_check_online_looks_at_port_and_broker_too(
    lfs10d: Lfs10d, sensors: PtyLine, mosquitto: Mosquitto, tmp_path: Path
) -> None:
    configured(tmp_path, sensors.path, mosquitto.port, "[2]")
    done = lfs10d("check", "-c", "site.yaml", "--online")
    assert done.returncode == 0, done.stdout
    assert "publishing below the base topic works" in done.stdout
    configured(tmp_path, "/dev/nowhere", mosquitto.port, "[2]")
    done = lfs10d("check", "-c", "site.yaml", "--online", "--json")
    assert done.returncode == 69
    (found,) = [each["text"] for each in json.loads(done.stdout)["online"] if each["level"] == "fail"]
    assert found in {"/dev/nowhere is absent", "/dev/nowhere is not in this container"}


def test_daemons_of_one_file_are_found_among_the_processes(tmp_path: Path) -> None:
    def process(number: int, words: str, inside: str = "") -> None:
        folder = tmp_path / "proc" / str(number)
        folder.mkdir(parents=True)
        (folder / "cmdline").write_text(words.replace(" ", "\0"))
        (folder / "cwd").symlink_to(tmp_path)
        (folder / "status").write_text(f"Name:\tlfs10d\nNSpid:\t{number}{inside}\nThreads:\t2\n")

    process(4, f"{sys.executable} /opt/lfs10d/bin/lfs10d run -c site.yaml")
    process(5, f"/usr/bin/python3 -sP /usr/bin/lfs10d run --config={tmp_path}/site.yaml")
    process(6, "/usr/bin/python3 /usr/bin/lfs10d run -c other.yaml")
    process(7, "/usr/bin/python3 /usr/bin/lfs10d watch -c site.yaml")
    process(8, "/usr/bin/python3 /usr/bin/lfs10d run")
    process(9, "sudo lfs10d run -c site.yaml")
    process(10, "timeout 60 lfs10d run")
    process(12, "/usr/bin/python3 /usr/bin/lfs10d run", inside="\t1")
    process(11, "/opt/lfs10d/bin/python -m lfs10d run -c roof.yaml")
    assert list(rounds.running(tmp_path / "site.yaml", tmp_path / "proc")) == [4, 5]
    assert list(rounds.running(Path("/etc/lfs10d/lfs10d.yaml"), tmp_path / "proc")) == [8]
    assert list(rounds.running(tmp_path / "roof.yaml", tmp_path / "proc")) == [11]
