"""From the configuration to port, bus, scheduler and jobs."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d import profiles
from lfs10d.config.loader import LoadedConfig, load
from lfs10d.line.budget import timing_of
from lfs10d.line.settings import (
    access_target,
    device_specs,
    line_rules,
    poll_rules,
    port_settings,
    profile_codec,
    scan_plan,
    usual_codec,
)
from lfs10d.modbus.frames import Checksum, Framing
from lfs10d.modbus.port_settings import PortSettings, Rs485

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


def test_the_port_is_opened_as_configured(loaded: LoadedConfig) -> None:
    assert port_settings(loaded.config.line) == PortSettings(
        path="/dev/ttyUSB0", baudrate=19200, parity="even", databits=8, stopbits=2, low_latency=False,
        rs485=Rs485(rts_on_send=False, rts_after_send=True, delay_before_send=0.001, delay_after_send=0.002),
    )  # fmt: skip


def test_the_line_is_spoken_on_as_configured(loaded: LoadedConfig) -> None:
    rules = line_rules(loaded.config.line)
    timing = timing_of(loaded.config.line)

    assert (rules.extra_gap, rules.broadcast_delay, rules.echo) == (0.005, 0.05, "on")
    assert timing.character == 12 / 19200
    assert timing.gap == pytest.approx(3.5 * 12 / 19200 + 0.005)


def test_devices_are_polled_as_configured(loaded: LoadedConfig) -> None:
    mast, other = device_specs(loaded.config, loaded.profiles)
    rules = poll_rules(loaded.config.poll)

    assert (mast.name, mast.slave, mast.interval, mast.enabled, mast.response_timeout) == ("mast", 3, 0.25, True, 0.3)
    assert (mast.codec.framing, mast.codec.checksum) == (Framing.RTU, Checksum.CRC)
    assert (other.name, other.slave, other.interval, other.enabled, other.response_timeout) == (
        "slave-4", 4, 5.0, False, None,
    )  # fmt: skip
    assert other.codec.checksum is Checksum.SUM
    assert (rules.retries, rules.offline_after, rules.probe_interval_max) == (2, 5, 30.0)


def test_a_device_is_read_with_its_calibration(tmp_path: Path) -> None:
    file = tmp_path / "lfs10d.yaml"
    file.write_text("line: {port: tty}\nslaves: [{id: 3, calibration: {wind_speed: {scale: 1.1, offset: 1}}}, 4]\n")
    config = load(file)
    calibrated, plain = device_specs(config.config, config.profiles)
    registers = (0x4120, 0x0000)
    assert calibrated.profile.reads()[0].decode(registers) == {"wind_speed": 12.0}
    assert plain.profile.reads()[0].decode(registers) == {"wind_speed": 10.0}


@pytest.mark.parametrize(("asked", "polled"), [(0, 2.0), (2, 2.0), (3, 3.0)])
def test_as_fast_as_the_line_allows_is_no_faster_than_the_device_does(
    tmp_path: Path, asked: float, polled: float
) -> None:
    (tmp_path / "slow.yaml").write_text(
        "{name: slow, title: Slow, min_interval: 2s, request_gap: 300ms, "
        "values: [{name: a, register: 1, type: uint16, unit: m}]}"
    )
    file = tmp_path / "lfs10d.yaml"
    slave = f"{{id: 3, profile: slow.yaml, interval: {asked}}}"
    file.write_text(f"line: {{port: tty}}\nslaves: [{slave}]\nmqtt: {{host: localhost}}\n")
    config = load(file)
    (spec,) = device_specs(config.config, config.profiles)
    assert spec.interval == polled
    assert spec.request_gap == 0.3


def test_registers_are_accessed_as_the_device_is_polled_or_as_the_line_usually_speaks(loaded: LoadedConfig) -> None:
    mast, other = loaded.config.slaves
    known = access_target(loaded, 4, other)
    assert (known.slave, known.codec.checksum, known.profile) == (4, Checksum.SUM, loaded.profiles["eh600"])
    assert access_target(loaded, 3, mast).response_timeout == 0.3
    stranger = access_target(loaded, 9, None)
    assert (stranger.slave, stranger.codec, stranger.profile) == (9, usual_codec(loaded.config.line), None)


def test_a_scan_looks_at_the_lines_own_rate_first_and_at_both_of_an_lfs10(loaded: LoadedConfig) -> None:
    found = scan_plan(loaded, (1, 2), (), share=0.3)
    assert [timing.baudrate for timing in found.timings] == [19200, 9600]
    assert all(timing.character * timing.baudrate == pytest.approx(12) for timing in found.timings)
    assert (found.ids, found.line_rate, found.share) == ((1, 2), 19200, 0.3)
    assert found.codec.checksum is Checksum.CRC, "not all devices have the same one"
    assert found.profiles[0].name == "lfs10"
    chosen = scan_plan(loaded, (1,), (4800, 9600), share=1.0)
    assert [timing.baudrate for timing in chosen.timings] == [4800, 9600]
    assert chosen.share < 1, "polling goes on"


def test_a_scan_asks_with_the_check_that_all_devices_share(tmp_path: Path) -> None:
    file = tmp_path / "lfs10d.yaml"
    slave = "{id: 4, profile: eh600, checksum: sum}"
    file.write_text(f"line: {{port: tty}}\nslaves: [{slave}]\nmqtt: {{host: localhost}}\n")
    found = scan_plan(load(file), (1,), (), share=0.3)
    assert found.codec.checksum is Checksum.SUM
    assert {"sum"} <= {checksum for profile in found.profiles for checksum in profile.checksums}


def test_on_an_ascii_line_those_are_looked_for_that_speak_it_own_profiles_first(tmp_path: Path) -> None:
    own = (Path(profiles.__file__).parent / "ld-e.yaml").read_text().replace("name: ld-e", "name: mine")
    (tmp_path / "mine.yaml").write_text(own)
    file = tmp_path / "lfs10d.yaml"
    file.write_text(
        "line: {port: tty, framing: ascii, baudrate: 4800}\nslaves: [{id: 4, profile: mine.yaml}]\n"
        "mqtt: {host: localhost}\n"
    )
    found = scan_plan(load(file), (1,), (), share=0.3)
    assert found.codec.framing is Framing.ASCII
    assert [timing.baudrate for timing in found.timings] == [4800]
    assert found.profiles[0].name == "mine"
    assert all("ascii" in profile.framings for profile in found.profiles)


def test_a_device_that_is_not_configured_yet_is_read_with_the_check_of_its_profile(loaded: LoadedConfig) -> None:
    profile = loaded.profiles["eh600"]
    codec = profile_codec(loaded.config.line, profile)
    assert (codec.framing, codec.checksum.value) == (Framing.RTU, profile.checksum)


def test_a_line_without_rs485_settings_leaves_the_driver_as_it_is(loaded: LoadedConfig) -> None:
    assert port_settings(loaded.config.line.model_copy(update={"rs485": None})).rs485 is None
