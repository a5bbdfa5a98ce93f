"""What the station is told, and how it is spelled."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lfs10d.system.clock import Instant
from lfs10d.telemetry.info import DaemonInfo, LineInfo
from tests.support.stations import ONE_VALUE

DEVICE = replace(ONE_VALUE, name="mast-top", slave=3, label="Mast, 10 m", interval=0.25)


def test_an_instant_tells_the_wall_time_of_an_earlier_monotonic_time() -> None:
    now = Instant(mono=1000.0, wall=1_795_298_023.0, clock="synced")
    assert now.ts() == 1_795_298_023_000
    assert now.ts(999.003) == 1_795_298_022_003


@pytest.mark.parametrize(("fixed", "published"), [(None, "auto"), (0.2, 0.2)])
def test_a_learned_time_out_is_published_as_the_yaml_spells_it(fixed: float | None, published: object) -> None:
    assert replace(DEVICE, response_timeout=fixed).payload() == {
        "v": 1,
        "slave": 3,
        "label": "Mast, 10 m",
        "profile": "lfs10",
        "interval": 0.25,
        "enabled": True,
        "response_timeout": published,
        "request_gap": 0.0,
        "calibration": {},
    }


def test_the_array_of_devices_calls_the_slave_id() -> None:
    assert DEVICE.entry() == {
        "name": "mast-top",
        "id": 3,
        "label": "Mast, 10 m",
        "profile": "lfs10",
        "enabled": True,
        "interval": 0.25,
    }


def test_info_says_who_runs_since_when_and_by_which_clock() -> None:
    daemon = DaemonInfo("0.1", "gw", "k3f9a2c7", "k3f9a2c6", "abc", 2, {"version": "5"}, ("store",))
    assert daemon.payload(started=5, clock="unsynced") == {
        "v": 1,
        "version": "0.1",
        "host": "gw",
        "boot": "k3f9a2c7",
        "previous_boot": "k3f9a2c6",
        "started": 5,
        "config_hash": "abc",
        "changes": 2,
        "mqtt": {"version": "5"},
        "features": ["store"],
        "clock": "unsynced",
    }


def test_the_line_state_is_configuration_and_what_goes_on() -> None:
    line = LineInfo("line0", "/dev/ttyUSB0", 9600, "none", 8, 1, "rtu", 0.00365)
    assert line.payload(is_open=True, activity="polling", requests="ok") == {
        "v": 1,
        "port": "/dev/ttyUSB0",
        "baudrate": 9600,
        "parity": "none",
        "databits": 8,
        "stopbits": 1,
        "framing": "rtu",
        "open": True,
        "activity": "polling",
        "requests": "ok",
    }


def test_the_rest_of_a_device_is_the_longer_of_the_configured_and_the_learned() -> None:
    device = replace(DEVICE, request_gap=0.2)
    assert [device.payload(learned)["request_gap"] for learned in (0.0, 0.1, 0.4)] == [0.2, 0.2, 0.4]
