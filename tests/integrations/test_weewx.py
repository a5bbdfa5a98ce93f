"""The loop packets of the weewx driver in config/integrations/weewx."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

DRIVER = Path(__file__).parents[2] / "config/integrations/weewx/bin/user/lfs10d.py"
TS = 1795298022003


@pytest.fixture(scope="module")
def driver() -> ModuleType:
    spec = importlib.util.spec_from_file_location("weewx_lfs10d", DRIVER)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def sample(device: str, seq: int, ts: int = TS, boot: str = "k1", **values: object) -> dict[str, object]:
    return {"device": device, "boot": boot, "seq": seq, "ts": ts, "quality": "good", "error": None, **values}


def packet(**values: object) -> dict[str, object]:
    return {"dateTime": 1795298022, "usUnits": 17, **values}


def test_a_sample_is_a_packet_in_metres_per_second(driver: ModuleType) -> None:
    packets: Any = driver.WindPackets("mast")
    assert packets.packet(sample("mast", 1, wind_speed=12.34)) == packet(windSpeed=12.34)


def test_a_failed_poll_is_none_and_no_old_value_takes_its_place(driver: ModuleType) -> None:
    packets: Any = driver.WindPackets("mast")
    packets.packet(sample("mast", 1, wind_speed=12.34))
    assert packets.packet(sample("mast", 2, wind_speed=None)) == packet(windSpeed=None)
    assert packets.silence(TS / 1000) == packet(windSpeed=None)


def test_a_sample_that_comes_twice_is_one_packet_and_a_restart_counts_anew(driver: ModuleType) -> None:
    packets: Any = driver.WindPackets("mast")
    assert packets.packet(sample("mast", 7, wind_speed=1)) is not None
    assert packets.packet(sample("mast", 7, wind_speed=1)) is None
    assert packets.packet(sample("mast", 6, wind_speed=1)) is None
    assert packets.packet(sample("mast", 1, boot="k2", wind_speed=2)) == packet(windSpeed=2)


def test_the_direction_of_a_vane_goes_with_the_speed_while_it_is_fresh(driver: ModuleType) -> None:
    packets: Any = driver.WindPackets("mast", "vane")
    assert packets.packet(sample("mast", 1, wind_speed=5)) == packet(windSpeed=5)
    assert packets.packet(sample("vane", 1, wind_direction=270)) is None
    assert packets.packet(sample("mast", 2, wind_speed=5)) == packet(windSpeed=5, windDir=270)
    later = packets.packet(sample("mast", 3, TS + 6000, wind_speed=5))
    assert later == {"dateTime": 1795298028, "usUnits": 17, "windSpeed": 5, "windDir": None}
    packets.packet(sample("vane", 2, TS + 6000, wind_direction=None))
    assert packets.packet(sample("mast", 4, TS + 6000, wind_speed=5))["windDir"] is None
    assert packets.silence(TS / 1000) == packet(windSpeed=None, windDir=None)


def test_a_station_with_both_needs_no_vane(driver: ModuleType) -> None:
    packets: Any = driver.WindPackets("roof", "")
    assert packets.packet(sample("roof", 1, wind_speed=5, wind_direction=90)) == packet(windSpeed=5, windDir=90)


def test_the_gust_comes_from_the_statistics_of_the_anemometer(driver: ModuleType) -> None:
    packets: Any = driver.WindPackets("mast", "vane")
    statistics = {"device": "mast", "boot": "k1", "ts": TS, "gust_3s": 9.9, "mean_2m": 5.0}
    assert packets.packet(statistics) == packet(windGust=9.9)
    assert packets.packet({**statistics, "gust_3s": None}) == packet(windGust=None)
    assert packets.packet({**statistics, "device": "vane"}) is None


def test_what_is_no_news_of_these_devices_is_no_packet(driver: ModuleType) -> None:
    packets: Any = driver.WindPackets("mast")
    assert packets.packet(sample("other", 1, wind_speed=5)) is None
    assert packets.packet({"device": "mast", "wind_speed": 5}) is None
