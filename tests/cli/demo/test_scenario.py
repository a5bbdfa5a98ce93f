"""The files the demo writes are files a person could have written."""

from __future__ import annotations

from pathlib import Path

from lfs10d.cli.demo.scenario import SENSORS, configuration, faults, slaves
from lfs10d.config.loader import load
from lfs10d.line.jobs.scan_ids import ids_of
from lfs10d.simulator.fault_file import parse_faults


def test_the_daemon_accepts_its_file(tmp_path: Path) -> None:
    file = tmp_path / "lfs10d.yaml"
    file.write_text(configuration(tmp_path / 'a "line" of a user: #1', 18830, "3.1.1"))
    config = load(file).config
    assert config.line.port.endswith('a "line" of a user: #1')
    assert [(slave.id, slave.name, slave.label) for slave in config.slaves] == [
        (each.slave, each.name, each.label) for each in SENSORS
    ]
    assert (config.mqtt.host, config.mqtt.port, config.mqtt.version) == ("127.0.0.1", 18830, "3.1.1")


def test_the_simulator_accepts_its_faults_one_silent_one_noisy() -> None:
    ill = parse_faults(faults(), "faults.yaml", ids_of(slaves())).slaves
    assert {slave: [fault.fault for fault in entry.faults] for slave, entry in ill.items()} == {
        7: ["silent"],
        8: ["noisy"],
    }


def test_each_faulty_sensor_has_a_remark() -> None:
    assert [each.name for each in SENSORS if each.remark] == [each.name for each in SENSORS if each.fault]
    assert len(SENSORS) == 8
