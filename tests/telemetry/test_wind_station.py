"""The wind statistics of a line in virtual time: when they are published, and what of records, clocks and changes."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from math import sin
from typing import cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfs10d.reading import Reading
from lfs10d.telemetry.contract import check
from lfs10d.telemetry.info import DeviceInfo, WindInfo
from lfs10d.telemetry.wind_station import WindStation
from tests.support.naive_wind import Good, Naive
from tests.support.stations import ONE_VALUE
from tests.support.winds import ANEMOMETER, MIDNIGHT, SONIC, TEN_MINUTES, VANE, Weather, reading, silence, weather

Speed = Callable[[float], float]


def gusty(at: float) -> float:
    return round(8 + 3 * sin(at / 7) + 2 * sin(at / 1.7), 2)


def with_wind(of: DeviceInfo, **changes: float) -> DeviceInfo:
    assert of.wind is not None
    return replace(of, wind=WindInfo(of.wind.values, **{"every": of.wind.every, "records": of.wind.records, **changes}))


def times(of: Weather, leaf: str) -> list[float]:
    return [(cast("int", payload["ts"]) / 1000 - of.shift) for payload in of.all(leaf)]


# -- the topic wind -----------------------------------------------------------------------------------------------


def test_it_is_published_every_so_often_retained_and_as_promised() -> None:
    line = weather()
    line.run(60.5, gusty)
    assert times(line, "wind") == [pytest.approx(10 * count, abs=0.01) for count in range(1, 7)]
    newest = line.newest("wind")
    assert (newest["line"], newest["device"], newest["boot"]) == ("line0", "a", "k3f9a2c7")
    for each in line.published:
        assert (each.topic, each.retain, each.qos, each.sample) == ("device/a/wind", True, 1, None)
        assert check(each.topic, json.dumps(each.payload)) is not None


def test_when_the_newest_value_holds_no_longer_it_is_published_at_once() -> None:
    line = weather()
    line.run(71, gusty)
    assert line.newest("wind")["gust_3s"] is not None
    line.run(79)
    assert times(line, "wind")[-1] == pytest.approx(73, abs=0.01)
    assert line.newest("wind")["gust_3s"] is None
    assert [each.refresh for each in line.published[-2:]] == [True, False]


def test_each_mean_is_published_as_null_when_it_has_too_little_left_however_seldom_it_is_published_else() -> None:
    line = weather(with_wind(ANEMOMETER, every=3600.0))
    line.run(1201, gusty)
    line.station.burst("a", line.instant(1201))
    line.run(3000)
    shown = [(round(at), payload["mean_2m"] is None, payload["mean_10m"] is None)
             for at, payload in zip(times(line, "wind"), line.all("wind"), strict=True)]  # fmt: skip
    assert shown == [(1203, False, False), (1263, True, False), (1503, True, True)]


def test_single_failed_polls_make_no_gap() -> None:
    line = weather()
    line.run(100, gusty)
    line.station.on_reading(silence("a", 101), line.instant(101))
    line.run(101)
    line.run(130, gusty)
    assert line.newest("wind")["coverage_2m"] == round(119 / 120, 4) or line.newest("wind")["samples_10m"] == 129
    assert not [each for each in line.published if not each.refresh]


def test_after_an_outage_it_is_watched_again() -> None:
    line = weather()
    line.run(60, gusty)
    line.run(75)
    line.run(100, gusty)
    line.run(109)
    assert [round(at) for at in times(line, "wind") if round(at) % 10] == [62, 102]


def test_no_reading_of_another_device_a_failed_poll_or_an_older_value_counts() -> None:
    line = weather()
    line.station.on_reading(reading("other", 1, wind_speed=5.0), line.instant(1))
    line.station.on_reading(silence("a", 1), line.instant(1))
    old = Reading("a", 1, {"wind_speed": 5.0}, None, 0.02, online=True, response_timeout=0.2, ages={"wind_speed": 30.0})
    line.station.on_reading(old, line.instant(1))
    line.run(10.5)
    assert line.newest("wind")["samples_10m"] == 0


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


def test_above_1_s_it_is_undersampled_and_holds_for_two_intervals() -> None:
    line = weather(replace(ANEMOMETER, interval=5.0))
    line.run(100, gusty, every=5.0)
    line.run(120)
    newest = line.newest("wind")
    assert (newest["undersampled"], newest["gust_10m"]) == (True, None)
    assert newest["coverage_2m"] == round((105 + 0) / 120, 4)


# -- records ------------------------------------------------------------------------------------------------------


def test_at_every_multiple_of_utc_there_is_a_record_with_a_number_of_its_own() -> None:
    line = weather(wall=MIDNIGHT - 250)
    line.run(1500, gusty)
    records = line.all("record")
    assert [each["seq"] for each in records] == [1, 2, 3]
    assert [each["to"] for each in records] == [round((MIDNIGHT + 600 * count) * 1000) for count in range(3)]
    assert [each["samples"] for each in records] == [249, 600, 600]
    assert records[0]["coverage"] == round(249 / 600, 4)
    assert records[0]["mean"] is None
    for each in line.published:
        assert check(each.topic, json.dumps(each.payload)) is not None
        if each.topic == "device/a/record":
            assert (each.retain, each.qos, each.kind) == (False, 1, "sample")
            assert each.sample is not None
            assert each.sample.payload("line0") == each.payload


def test_every_record_is_exactly_what_a_naive_reference_counts() -> None:
    line, values = weather(with_wind(ANEMOMETER, records=60.0), wall=MIDNIGHT - 7.3), list[Good]()
    for place in range(1, 1700):
        at = place * 0.37
        gap = place % 97 < 9
        if not gap:
            line.station.on_reading(reading("a", at, wind_speed=gusty(at)), line.instant(at))
            values.append((line.instant(at).ts(at), gusty(at), 2000))
        line.run(at)
    naive = Naive(values)
    assert len(line.all("record")) == 11
    for each in line.all("record"):
        begin, end = cast("int", each["from"]), cast("int", each["to"])
        taken = naive.gusts(begin, end)
        covered = naive.covered(begin, end)
        assert each["samples"] == len(naive.measured(begin, end))
        assert each["coverage"] == pytest.approx(covered / 60_000, abs=1e-4)
        assert each["gust"] == pytest.approx(max(taken)[0], abs=1e-6)
        assert each["lull"] == pytest.approx(min(taken)[0], abs=1e-6)
        for peak in ("gust", "lull"):
            assert any(at == each[f"{peak}_ts"] and gust == pytest.approx(each[peak], abs=1e-6) for gust, at in taken)
        assert each["max"] == max(value for _, value, _ in naive.measured(begin, end))
        if 2 * covered >= 60_000:
            assert each["mean"] == pytest.approx(naive.mean(begin, end), abs=1e-6)
            assert each["stddev"] == pytest.approx(naive.deviation(begin, end), abs=1e-5)


def test_a_span_without_a_good_sample_is_a_record_of_nulls() -> None:
    line = weather()
    line.run(1300)
    first, second = line.all("record")
    assert (first["seq"], second["seq"]) == (1, 2)
    for each in (first, second):
        assert (each["mean"], each["gust"], each["max"], each["samples"], each["coverage"]) == (
            None,
            None,
            None,
            0,
            0.0,
        )


def test_a_record_of_an_hour_counts_all_of_it_though_less_is_kept() -> None:
    line = weather(with_wind(ANEMOMETER, records=3600.0))
    line.run(3700, lambda at: 20.0 if 100 <= at < 103 else 5.0)
    [record] = line.all("record")
    assert (record["samples"], record["gust"], record["max"]) == (3599, 20.0, 20.0)
    assert record["gust_ts"] == round((MIDNIGHT + 102) * 1000)
    assert record["mean"] == pytest.approx(5 + 45 / 3599, abs=1e-6)


def test_of_a_long_record_what_is_added_up_already_stays_in_the_span_that_runs_when_the_clock_is_set() -> None:
    line = weather(with_wind(ANEMOMETER, records=1800.0))
    line.run(1500, gusty)
    line.shift += 900  # 23:65 becomes 24:10: the next half hour begins at once
    line.run(1600, gusty)
    [record] = line.all("record")
    assert record["to"] == round((MIDNIGHT + 1800) * 1000)
    assert cast("int", record["samples"]) >= 660


@pytest.mark.parametrize(("records", "count"), [(0.0, 0), (60.0, 20), (300.0, 4), (900.0, 1)])
def test_records_are_as_long_as_configured_or_none(records: float, count: int) -> None:
    line = weather(with_wind(ANEMOMETER, records=records))
    line.run(1202, gusty)
    assert len(line.all("record")) == count


def test_a_vane_s_record_has_its_direction() -> None:
    line = weather(VANE, SONIC)
    for second in range(1, 602):
        values = {"wind_speed": 6.0, "wind_direction": 350.0 if second % 2 else 10.0}
        for device in ("v", "s"):
            line.station.on_reading(reading(device, second, **values), line.instant(second))
        line.run(second)
    vane, sonic = line.all("record")
    assert (vane["direction"], vane["mean"], vane["samples"], vane["unit"]) == (360, None, 599, None)
    assert (sonic["direction"], sonic["mean"], sonic["samples"], sonic["unit"]) == (360, 6.0, 599, "m/s")
    assert vane["direction_stddev"] == pytest.approx(10.0, abs=0.1)
    for each in line.published:
        assert check(each.topic, json.dumps(each.payload)) is not None


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
    line.run(1802, gusty)
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


# -- changes ------------------------------------------------------------------------------------------------------


def test_another_boot_begins_anew() -> None:
    line = weather()
    line.run(700, gusty)
    later = Weather(WindStation("line0", "k3f9a2c8", [ANEMOMETER], line.instant(701)), line.shift, now=701)
    later.run(720, gusty)
    assert cast("int", later.newest("wind")["samples_10m"]) < 20
    later.run(1210, gusty)
    assert [(each["boot"], each["seq"]) for each in later.all("record")] == [("k3f9a2c8", 1)]


def test_other_times_take_effect_at_once() -> None:
    line = weather()
    line.run(61, gusty)
    line.published += line.station.configure([with_wind(ANEMOMETER, every=1.0, records=60.0)], line.instant(61))
    line.run(125.5, gusty)
    assert len([at for at in times(line, "wind") if at > 61]) == 64
    assert [each["to"] for each in line.all("record")] == [round((MIDNIGHT + 120) * 1000)]
    assert line.all("record")[0]["samples"] == 59  # the span that ran began anew
    line.published += line.station.configure([with_wind(ANEMOMETER, records=0.0)], line.instant(125.5))
    line.run(1300, gusty)
    assert len(line.all("record")) == 1


def test_a_device_that_is_disabled_runs_out_and_falls_silent_and_comes_back() -> None:
    line = weather()
    line.run(900, gusty)
    off = replace(ANEMOMETER, enabled=False)
    line.published += line.station.configure([off], line.instant(900.5))
    assert line.newest("wind")["gust_3s"] is None
    line.station.on_reading(reading("a", 901, wind_speed=5.0), line.instant(901))  # for a request alone
    line.run(1700)
    assert line.newest("wind")["samples_10m"] == 0
    assert len(line.all("record")) == 2  # in the second it was enabled for a while
    count = len(line.published)
    line.run(4000)
    assert len(line.published) == count
    line.published += line.station.configure([ANEMOMETER], line.instant(4000))
    line.run(4300, gusty)
    assert cast("int", line.newest("wind")["samples_10m"]) >= 290
    assert [each["seq"] for each in line.all("record")] == [1, 2, 3]


def test_disabling_what_shows_nothing_publishes_nothing() -> None:
    line = weather()
    assert line.station.configure([replace(ANEMOMETER, enabled=False)], line.instant(1)) == []


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
