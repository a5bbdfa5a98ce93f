"""The wind statistics of a device in virtual time: when they are published, its records, and what changes them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from math import sin
from typing import cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from docs.generate.contract import check
from lfs10d.telemetry.info import DeviceInfo, WindInfo
from tests.support.naive_wind import Good, Naive
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


def test_above_1_s_it_is_undersampled_and_holds_for_two_intervals() -> None:
    line = weather(replace(ANEMOMETER, interval=5.0))
    line.run(100, gusty, every=5.0)
    line.run(121)
    newest = line.newest("wind")
    assert (newest["undersampled"], newest["gust_10m"]) == (True, None)
    assert newest["coverage_2m"] == round(105 / 120, 4)


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


# -- changes ------------------------------------------------------------------------------------------------------


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


def test_a_live_view_shows_what_was_published_last() -> None:
    line = weather()
    line.run(75, lambda _: 6.0)
    shown = cast("dict[str, object]", line.station.snapshot("a")["wind"])
    assert (shown["mean_2m"], shown["gust_10m"]) == (6.0, 6.0)


# -- readings that come late ------------------------------------------------------------------------------------------


@settings(max_examples=20)
@given(delays=st.lists(st.floats(0.0, 0.7), min_size=20, max_size=20), silent=st.booleans())
def test_figures_are_of_all_samples_up_to_the_time_that_the_message_says_however_late_these_came(
    delays: list[float], *, silent: bool
) -> None:
    line, values, handed_over = weather(with_wind(ANEMOMETER, records=60.0, hold=0.2)), list[Good](), 0.0
    for place in range(1, 700):
        if silent and place % 100 < 20:
            continue
        at = place * 0.25 - 0.0004
        handed_over = max(handed_over, at + delays[place % len(delays)])  # those of one device stay in order
        line.run(handed_over)
        line.station.on_reading(reading("a", at, wind_speed=gusty(at)), line.instant(handed_over))
        values.append((line.instant(at).ts(), gusty(at), 2000))
    naive = Naive(values)
    assert len(line.all("wind")) >= 17
    assert len(line.all("record")) == 2
    for each in line.all("wind"):
        ts = cast("int", each["ts"])
        known = naive.measured(ts - TEN_MINUTES + 1, ts + 1)
        assert each["samples_10m"] == len(known)
        assert each["max_10m"] == max((value for _, value, _ in known), default=None)
        assert each["coverage_10m"] == pytest.approx(naive.covered(ts - TEN_MINUTES, ts) / TEN_MINUTES, abs=1e-4)
    for each in line.all("record"):
        assert each["samples"] == len(naive.measured(cast("int", each["from"]), cast("int", each["to"])))


def test_a_record_waits_for_the_proof_of_its_last_samples_and_no_longer_than_a_reading_from_after_its_end() -> None:
    line = weather()
    line.run(599, gusty)
    line.run(600.9)
    assert line.all("record") == []
    for at in (599.5, 599.9, 600.2):  # held back together, until the last of them was proved
        line.station.on_reading(reading("a", at, wind_speed=5.0), line.instant(600.9))
    line.run(600.91)
    [record] = line.all("record")
    assert record["samples"] == 601
    line.run(1210)
    assert len(line.all("record")) == 2
    line.station.on_reading(reading("a", 1799.9, wind_speed=5.0), line.instant(1800.9))
    line.run(1801.49)
    assert len(line.all("record")) == 2
    line.run(1801.51)  # nothing came from after its end
    assert line.newest("record")["samples"] == 1


def test_a_message_says_the_time_of_the_newest_sample_or_that_of_a_moment_ago() -> None:
    line = weather(with_wind(ANEMOMETER, hold=0.1))
    line.station.on_reading(reading("a", 9.8, wind_speed=5.0), line.instant(9.9))
    line.run(10.5)
    assert times(line, "wind") == [pytest.approx(9.8, abs=0.001)]
    line.run(20.5)
    assert times(line, "wind")[1:] == [pytest.approx(20 - 1.6, abs=0.01)]
    line.station.on_reading(reading("a", 30.0, wind_speed=5.0), line.instant(30.0))
    [burst] = line.station.burst("a", line.instant(29.99))
    assert cast("dict[str, object]", burst.payload)["ts"] == line.instant(30.0).ts()
