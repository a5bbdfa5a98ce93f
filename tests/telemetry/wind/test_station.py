"""The wind statistics of a line in virtual time: when they are published, and what of records, clocks and changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from math import sin
from typing import cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfs10d.reading import Reading
from lfs10d.telemetry.info import DeviceInfo, WindInfo
from lfs10d.telemetry.wind.station import WindStation
from tests.support.stations import ONE_VALUE
from tests.support.winds import ANEMOMETER, MIDNIGHT, TEN_MINUTES, Weather, reading, silence, weather

Speed = Callable[[float], float]


def gusty(at: float) -> float:
    return round(8 + 3 * sin(at / 7) + 2 * sin(at / 1.7), 2)


def with_wind(of: DeviceInfo, **changes: float) -> DeviceInfo:
    assert of.wind is not None
    return replace(of, wind=WindInfo(of.wind.values, **{"every": of.wind.every, "records": of.wind.records, **changes}))


def times(of: Weather, leaf: str) -> list[float]:
    return [(cast("int", payload["ts"]) / 1000 - of.shift) for payload in of.all(leaf)]


# -- readings


def test_after_an_outage_it_is_watched_again() -> None:
    line = weather()
    line.run(60, gusty)
    line.run(75)
    line.run(100, gusty)
    line.run(109)
    between = [time for time, each in zip(times(line, "wind"), line.published, strict=True) if not each.refresh]
    assert between == [pytest.approx(62, abs=0.01), pytest.approx(102, abs=0.01)]


def test_no_reading_of_another_device_a_failed_poll_or_an_older_value_counts() -> None:
    line = weather()
    line.station.on_reading(reading("other", 1, wind_speed=5.0), line.instant(1))
    line.station.on_reading(silence("a", 1), line.instant(1))
    old = Reading("a", 1, {"wind_speed": 5.0}, None, 0.02, online=True, response_timeout=0.2, ages={"wind_speed": 30.0})
    line.station.on_reading(old, line.instant(1))
    line.run(10.5)
    assert line.newest("wind")["samples_10m"] == 0


def test_values_that_run_out_after_another_device_is_due_move_no_tick() -> None:
    line = weather(with_wind(ANEMOMETER, every=2.0), replace(with_wind(ANEMOMETER, every=100.0), name="b"))
    before = line.station.due
    line.station.on_reading(reading("b", 0.5, wind_speed=5.0), line.instant(0.5))
    assert line.station.due == before
    line.run(3.0)
    assert [each.topic for each in line.published] == ["device/a/wind"]


def test_a_device_without_wind_has_neither_topic_nor_figures() -> None:
    line = weather(ONE_VALUE)
    assert line.station.topics() == []
    assert line.station.burst("a", line.instant(0)) == []
    assert line.station.snapshot("a") == {}
    assert line.station.due == float("inf")


def test_a_burst_has_the_figures_of_the_moment_and_a_live_view_those_published_last() -> None:
    line = weather()
    line.run(65, lambda _: 6.0)
    [burst] = line.station.burst("a", line.instant(65))
    assert cast("dict[str, object]", burst.payload)["mean_2m"] == 6.0
    assert line.station.topics() == ["device/a/wind"]
    shown = cast("dict[str, object]", line.station.snapshot("a")["wind"])
    assert shown == {
        "ts": round((MIDNIGHT + 65) * 1000), "unit": "m/s", "mean_2m": 6.0, "mean_10m": None, "gust_3s": 6.0,
        "gust_10m": 6.0,
    }  # fmt: skip


def test_a_disabled_device_is_not_counted_though_a_request_reads_it() -> None:
    line = weather(replace(ANEMOMETER, enabled=False))
    line.station.on_reading(reading("a", 1, wind_speed=5.0), line.instant(1))
    assert cast("dict[str, object]", line.station.burst("a", line.instant(1))[0].payload)["samples_10m"] == 0


# -- clocks -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", [-7200.0, -3.0, 3.0, 86_400.0 * 2000])
def test_a_clock_that_is_set_changes_no_figure_of_the_last_minutes(step: float) -> None:
    steady, stepped = weather(), weather()
    for line in (steady, stepped):
        line.run(500, gusty)
        if line is stepped:
            line.shift += step
        line.run(900, gusty)
    dated = {"ts", "time", "gust_10m_ts", "lull_10m_ts"}
    plain = [{key: value for key, value in line.newest("wind").items() if key not in dated}
             for line in (steady, stepped)]  # fmt: skip
    assert plain[0] == plain[1]
    for name in ("ts", "gust_10m_ts", "lull_10m_ts"):
        moved = cast("int", stepped.newest("wind")[name]) - cast("int", steady.newest("wind")[name])
        assert moved == round(step * 1000)


def test_a_clock_that_jumps_years_ahead_makes_one_record_for_what_was_measured() -> None:
    line = weather(wall=1000.0)
    line.clock = "unsynced"
    line.run(100, gusty)
    line.shift, line.clock = MIDNIGHT, "synced"
    line.run(1300, gusty)
    assert [(each["seq"], each["to"]) for each in line.all("record")] == [
        (1, round((MIDNIGHT + 600) * 1000)),
        (2, round((MIDNIGHT + 1200) * 1000)),
    ]
    assert line.all("record")[0]["samples"] == 599


@pytest.mark.parametrize(
    "begin",
    [
        datetime(2026, 3, 29, 0, 50, tzinfo=UTC),  # Berlin skips an hour at 1:00 UTC
        datetime(2026, 10, 25, 0, 50, tzinfo=UTC),  # and repeats one
        datetime(2016, 12, 31, 23, 50, tzinfo=UTC),  # a leap second, which POSIX time repeats or smears
        datetime(2026, 12, 31, 23, 50, tzinfo=UTC),
    ],
)
def test_records_follow_utc_whatever_civil_time_does(begin: datetime) -> None:
    line = weather(wall=begin.timestamp())
    line.run(595, gusty)
    if begin.year == 2016:
        line.shift -= 1.0  # the leap second
    line.run(1803, gusty)
    assert [each["to"] for each in line.all("record")] == [
        round((begin.timestamp() + 600 * count) * 1000) for count in (1, 2, 3)
    ]
    assert [each["seq"] for each in line.all("record")] == [1, 2, 3]


@settings(max_examples=25)
@given(st.lists(st.tuples(st.floats(1, 500), st.floats(-2000, 2000)), min_size=1, max_size=5))
def test_whatever_the_clock_does_every_sample_is_in_one_record_and_numbers_have_no_gap(
    steps: list[tuple[float, float]],
) -> None:
    line, until = weather(), 0.0
    for passed, step in steps:
        until += passed
        line.run(until, gusty)
        line.shift += step
    end = until + 1300
    line.run(end, gusty)
    records = line.all("record")
    assert [each["seq"] for each in records] == list(range(1, len(records) + 1))
    assert all(cast("int", each["to"]) % TEN_MINUTES == 0 for each in records)
    recorded = sum(cast("int", each["samples"]) for each in records)
    assert int(end) - 603 <= recorded <= int(end)


# -- changes


def test_another_boot_begins_anew() -> None:
    line = weather()
    line.run(700, gusty)
    later = Weather(WindStation("line0", "k3f9a2c8", [ANEMOMETER], line.instant(701)), line.shift, now=701)
    later.run(720, gusty)
    assert cast("int", later.newest("wind")["samples_10m"]) < 20
    later.run(1210, gusty)
    assert [(each["boot"], each["seq"]) for each in later.all("record")] == [("k3f9a2c8", 1)]


def test_a_device_that_comes_back_counts_its_records_on() -> None:
    line = weather()
    line.run(601, gusty)
    assert line.station.configure([], line.instant(602)) == []
    [published] = line.station.configure([ANEMOMETER], line.instant(700))
    assert cast("dict[str, object]", published.payload)["samples_10m"] == 0
    line.now = 700
    line.run(1300, gusty)
    assert [each["seq"] for each in line.all("record")] == [1, 2]


def test_a_device_that_stays_without_its_wind_has_its_topic_cleared() -> None:
    line = weather()
    line.run(601, gusty)
    [cleared] = line.station.configure([replace(ONE_VALUE, profile="ld-e")], line.instant(602))
    assert (cleared.topic, cleared.payload, cleared.retain) == ("device/a/wind", None, True)
    assert line.station.topics() == []


def test_another_profile_begins_anew_and_counts_its_records_on() -> None:
    line = weather()
    line.run(601, gusty)
    [published] = line.station.configure([replace(ANEMOMETER, profile="other")], line.instant(602))
    assert cast("dict[str, object]", published.payload)["samples_10m"] == 0
    line.run(1300, gusty)
    assert [each["seq"] for each in line.all("record")] == [1, 2]


def test_a_device_that_stays_the_same_takes_other_times() -> None:
    line = weather()
    line.run(100, gusty)
    assert line.station.configure([with_wind(ANEMOMETER, every=1.0)], line.instant(100)) == []
    assert line.station.due <= 101.01


def test_after_a_burst_each_device_is_watched_as_before() -> None:
    line = weather()
    line.run(4, gusty)
    line.station.burst("a", line.instant(4))
    line.run(9)
    assert times(line, "wind") == [pytest.approx(6, abs=0.01)]
    assert line.newest("wind")["gust_3s"] is None


def test_only_what_is_due_is_looked_at() -> None:
    others = [with_wind(replace(ANEMOMETER, name=name), every=every) for name, every in (("b", 7.0), ("c", 3600.0))]
    line = weather(ANEMOMETER, *others)
    line.run(30.5)
    assert [each.topic.split("/")[1] for each in line.published] == ["b", "a", "b", "a", "b", "b", "a"]
