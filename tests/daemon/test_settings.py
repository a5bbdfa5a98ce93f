"""From the configuration to what is published of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.config.loader import LoadedConfig, load
from lfs10d.daemon.settings import config_hash, device_infos, line_info
from lfs10d.line.budget import timing_of
from lfs10d.telemetry.info import WindInfo, WindValues

FILE = """
line:
  {port: /dev/ttyUSB0, baudrate: 19200, parity: even, stopbits: 2, extra_gap: 5ms, turnaround_delay: 50ms, echo: "on",
   low_latency: false, rs485: {rts_on_send: false, rts_after_send: true, delay_before_send: 1ms, delay_after_send: 2ms}}
poll: {interval: 250ms, retries: 2, offline_after: 5, probe_interval_max: 30s}
slaves:
  - {id: 3, name: mast, label: "Mast, 10 m", response_timeout: 300ms}
  - {id: 4, profile: eh600, interval: 5s, enabled: false, checksum: sum}
mqtt: {host: localhost}
"""


@pytest.fixture
def loaded(tmp_path: Path) -> LoadedConfig:
    """Give a configuration in which nothing is a default."""
    file = tmp_path / "lfs10d.yaml"
    file.write_text(FILE)
    return load(file)


def test_the_line_is_described_with_the_gap_that_is_kept_on_it(loaded: LoadedConfig) -> None:
    assert line_info(loaded.config.line).gap_required == timing_of(loaded.config.line).gap


def test_devices_are_described_as_configured(loaded: LoadedConfig) -> None:
    facts = device_infos(loaded.config, loaded.profiles)
    assert [(one.name, one.slave, one.label, one.profile) for one in facts] == [
        ("mast", 3, "Mast, 10 m", "lfs10"),
        ("slave-4", 4, None, "eh600"),
    ]
    assert facts[0].units == {"wind_speed": "m/s"}
    assert facts[0].offline_after == 5


def test_a_device_is_described_with_the_rest_that_its_profile_gives_it(tmp_path: Path) -> None:
    (tmp_path / "slow.yaml").write_text(
        "{name: slow, title: Slow, request_gap: 300ms, values: [{name: a, register: 1, type: uint16, unit: m}]}"
    )
    file = tmp_path / "lfs10d.yaml"
    file.write_text("line: {port: tty}\nslaves: [{id: 3, profile: slow.yaml}]\nmqtt: {host: localhost}\n")
    config = load(file)
    assert device_infos(config.config, config.profiles)[0].request_gap == 0.3


def test_a_device_is_described_with_its_calibration(tmp_path: Path) -> None:
    file = tmp_path / "lfs10d.yaml"
    file.write_text("line: {port: tty}\nslaves: [{id: 3, calibration: {wind_speed: {scale: 1.1}}}, 4]\n")
    config = load(file)
    told = [info.payload()["calibration"] for info in device_infos(config.config, config.profiles)]
    assert told == [{"wind_speed": {"scale": 1.1, "offset": 0.0}}, {}]


def test_the_hash_tells_configurations_apart(loaded: LoadedConfig, tmp_path: Path) -> None:
    same, other = tmp_path / "same" / "lfs10d.yaml", tmp_path / "other" / "lfs10d.yaml"
    for file, text in ((same, FILE + "# a comment\n"), (other, FILE.replace("250ms", "251ms"))):
        file.parent.mkdir()
        file.write_text(text)

    assert config_hash(load(same).config) == config_hash(loaded.config)
    assert config_hash(load(other).config) != config_hash(loaded.config)
    assert len(config_hash(loaded.config)) == 12


VANE = (
    "{name: sonic, title: Sonic, values: ["
    "{name: gust, register: 1, type: uint16, unit: UNIT, device_class: wind_speed}, "
    "{name: from, register: 2, type: uint16, unit: \u00b0, device_class: wind_direction}]}"
)


@pytest.mark.parametrize(
    ("unit", "values"),
    [("km/h", WindValues("gust", "from", "km/h")), ("furlongs", WindValues(None, "from", None))],
)
def test_a_device_has_wind_statistics_of_the_first_values_of_their_classes_in_a_unit_that_is_known(
    tmp_path: Path, unit: str, values: WindValues
) -> None:
    (tmp_path / "sonic.yaml").write_text(VANE.replace("UNIT", unit))
    file = tmp_path / "lfs10d.yaml"
    file.write_text(
        "line: {port: tty}\nslaves: [{id: 3, profile: sonic.yaml}, 4, {id: 5, profile: eh600}]\n"
        "mqtt: {host: localhost}\nwind: {every: 1m, records: 1h}\n"
    )
    config = load(file)
    sonic, lfs10, inverter = (each.wind for each in device_infos(config.config, config.profiles))
    assert sonic == WindInfo(values, every=60.0, records=3600.0, hold=0.02)
    assert lfs10 == WindInfo(WindValues("wind_speed", None, "m/s"), every=60.0, records=3600.0, hold=0.02)
    assert inverter is None
