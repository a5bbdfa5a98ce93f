"""The figures for Prometheus: names of the contract, absent where there is no good value."""

from __future__ import annotations

import math
import re
import subprocess
from typing import Any

import pytest
from prometheus_client.openmetrics.parser import text_string_to_metric_families as parsed_openmetrics
from prometheus_client.parser import text_string_to_metric_families as parsed_text

from lfs10d import __version__
from lfs10d.web import metrics
from tests.support.brokers import path_of
from tests.web.lines import PublishedLine, entry, sample


def families(text: str, *, openmetrics: bool) -> list[Any]:
    """Return the metrics as prometheus_client reads them; it refuses what is not of the format."""
    parse: Any = parsed_openmetrics if openmetrics else parsed_text
    return list(parse(text))


def samples(line: PublishedLine) -> dict[str, float]:
    """Return every sample of both formats, which must be the same; by name and labels."""
    shown = {}
    for wanted in (False, True):
        text = metrics.text([line.model], line.wall, openmetrics=wanted)
        found = {}
        for family in families(text, openmetrics=wanted):
            for each in family.samples:
                labels = ",".join(f"{key}={value}" for key, value in sorted(each.labels.items()))
                found[f"{each.name}{{{labels}}}"] = each.value
        shown[wanted] = found
    assert shown[False] == shown[True]
    return shown[True]


@pytest.fixture
def line() -> PublishedLine:
    made = PublishedLine()
    made.measure(1, 12.34)
    made.publish("device/mast/availability", "online")
    made.publish("device/mast/stats", {"polls": 10, "good": 8, "errors": {"timeout": 2, "No!": 3, "x": None},
                                       "rtt_ms": {"p50": 18.2, "p95": None}, "last_good_ts": 1})  # fmt: skip
    made.publish("line/stats", {"load_pct": 44.0, "exchanges": 100, "errors": {"timeout": 2, "overrun": 50},
                                "gap_us": {"min": 3675.5, "p50": 4000.0, "p99": None},
                                "store": {"depth": 3, "dropped": 7}})  # fmt: skip
    return made


def test_every_figure_of_the_contract(line: PublishedLine) -> None:
    device = "device=mast,line=line0"
    assert samples(line) == {
        f"lfs10d_build_info{{version={__version__}}}": 1,
        "lfs10d_mqtt_connected{line=line0}": 1,
        "lfs10d_line_load_ratio{line=line0}": 0.44,
        "lfs10d_line_exchanges_total{line=line0,result=ok}": 98,
        "lfs10d_line_exchanges_total{line=line0,result=timeout}": 2,
        "lfs10d_line_gap_seconds{line=line0,quantile=0}": 0.0036755,
        "lfs10d_line_gap_seconds{line=line0,quantile=0.5}": 0.004,
        "lfs10d_store_samples{line=line0}": 3,
        "lfs10d_store_dropped_total{line=line0}": 7,
        f"lfs10d_device_online{{{device}}}": 1,
        f"lfs10d_device_wind_speed_meters_per_second{{{device}}}": 12.34,
        f"lfs10d_device_polls_total{{{device}}}": 10,
        f"lfs10d_device_poll_errors_total{{code=timeout,{device}}}": 2,
        f"lfs10d_device_response_seconds{{{device},quantile=0.5}}": 0.0182,
        f"lfs10d_device_last_good_timestamp_seconds{{{device}}}": round(line.wall * 1000) / 1000,
    }


@pytest.mark.needs("promtool")
def test_promtool_finds_nothing_wrong(line: PublishedLine) -> None:
    text = metrics.text([line.model], line.wall, openmetrics=False)
    checked = subprocess.run(
        [path_of("promtool"), "check", "metrics"], input=text, capture_output=True, text=True, check=False
    )
    assert (checked.returncode, checked.stdout, checked.stderr) == (0, "", "")


def test_a_bad_value_is_absent(line: PublishedLine) -> None:
    line.measure(2, None)
    assert not [name for name in samples(line) if "wind_speed" in name]
    assert samples(line)["lfs10d_device_polls_total{device=mast,line=line0}"] == 10


def test_an_old_value_is_absent(line: PublishedLine) -> None:
    line.wall += 3.0
    assert [name for name in samples(line) if "wind_speed" in name]
    line.wall += 2.0
    assert not [name for name in samples(line) if "wind_speed" in name]


def test_a_disabled_device_has_no_value(line: PublishedLine) -> None:
    line.publish("devices", [entry(enabled=False)])
    assert not [name for name in samples(line) if "wind_speed" in name]


def test_of_a_daemon_that_is_away_only_that_is_told(line: PublishedLine) -> None:
    line.publish("availability", "offline")
    assert samples(line) == {
        f"lfs10d_build_info{{version={__version__}}}": 1,
        "lfs10d_mqtt_connected{line=line0}": 0,
    }


def test_before_the_first_statistics_there_are_none() -> None:
    assert [name.partition("{")[0] for name in samples(PublishedLine())] == [
        "lfs10d_build_info", "lfs10d_mqtt_connected", "lfs10d_device_online",
    ]  # fmt: skip


def test_each_value_of_a_station_is_a_gauge_named_by_quantity_and_unit() -> None:
    line = PublishedLine()
    values: dict[str, Any] = {
        "temperature": 21.5, "humidity": 40, "direction_degrees": 270, "count": 7, "rain": 1.5, "odd": 1,
    }  # fmt: skip
    units = {"temperature": "°C", "humidity": "%RH", "direction_degrees": "°", "count": "1", "rain": "mm/h",
             "odd": "µg/m³", "wind_speed": "m/s"}  # fmt: skip
    line.publish("device/mast/telemetry", sample(1, line.wall, unit=None, units=units, quality="partial", **values))
    names = [name.partition("{")[0] for name in samples(line) if "device" in name and "online" not in name]
    assert [name.removeprefix("lfs10d_device_") for name in names[:-1]] == [
        "wind_speed_meters_per_second", "temperature_celsius", "humidity_percent", "direction_degrees", "count",
        "rain_millimeters_per_hour", "odd_g_m",
    ]  # fmt: skip


OWN_NAMES = {
    "online": "1", "polls": "1", "polls_total": "1", "poll_errors": "1", "poll_errors_created": "1", "response": "s",
    "response_seconds": "1", "response_seconds_count": "1", "last_good_timestamp": "s",
}  # fmt: skip
"""Values of a profile with their units that are named as metrics of our own."""


@pytest.mark.needs("promtool")
@pytest.mark.parametrize("name", OWN_NAMES)
def test_a_value_named_as_a_metric_of_our_own_has_another_name(line: PublishedLine, name: str) -> None:
    before = samples(line)
    line.publish("device/mast/telemetry", sample(9, line.wall, 12.34, **{name: 55, "units": {name: OWN_NAMES[name]}}))
    (new,) = samples(line).keys() - {each.replace("_meters_per_second", "") for each in before} - before.keys()
    assert new.partition("{")[0].endswith("_value")
    assert samples(line)[new] == 55
    test_promtool_finds_nothing_wrong(line)


def test_of_two_values_with_one_name_of_a_metric_the_first_is_shown(line: PublishedLine) -> None:
    line.publish("device/mast/telemetry", sample(9, line.wall, 12.34, **{"Gust 1": 7, "gust-1": 8, "units": {}}))
    assert samples(line)["lfs10d_device_gust_1{device=mast,line=line0}"] == 7
    text = metrics.text([line.model], line.wall, openmetrics=False)
    assert len(re.findall(r"^lfs10d_device_gust_1\{", text, re.MULTILINE)) == 1


@pytest.mark.parametrize("value", [True, "7", None, [], math.inf, -math.inf, math.nan, 10**400])
def test_what_is_no_number_is_absent(line: PublishedLine, value: object) -> None:
    line.publish("line/stats", {"load_pct": value, "exchanges": 1, "errors": [], "gap_us": 7, "store": value})
    line.publish("device/mast/stats", {"polls": value, "errors": value, "rtt_ms": value})
    names = {name.partition("{")[0] for name in samples(line)}
    assert "lfs10d_device_polls_total" not in names
    assert "lfs10d_line_load_ratio" not in names


def test_a_hostile_label_stays_within_its_quotes(line: PublishedLine) -> None:
    line.model.key = 'a"} 1\nlfs10d_evil{x="\\'
    text = metrics.text([line.model], line.wall, openmetrics=True)
    assert all(
        re.match(r"# (HELP|TYPE|UNIT|EOF)|lfs10d_(build|mqtt|line|store|device)", row) for row in text.splitlines()
    )
    assert not [family for family in families(text, openmetrics=True) if "evil" in family.name]


@pytest.mark.parametrize(
    ("accept", "wanted"),
    [
        ("", False), ("*/*", False), ("text/plain", False), ("application/openmetrics-text", True),
        ("application/openmetrics-text;version=1.0.0,text/plain;version=0.0.4;q=0.5,*/*;q=0.1", True),
        ("application/openmetrics-text;q=0.2,text/plain;q=0.9", False), ("application/openmetrics-text;q=0", False),
        ("application/openmetrics-text;q=x", False), ("Application/OpenMetrics-Text; Q=1", True),
    ],
)  # fmt: skip
def test_which_format_is_wanted(accept: str, wanted: bool) -> None:  # noqa: FBT001 - a claim
    assert metrics.openmetrics_wanted(accept) is wanted


def test_a_figure_is_written_as_a_whole_number_where_it_is_one() -> None:
    family = metrics.Family("x", "gauge", "x")
    for place, value in enumerate((3.0, 0.1 + 0.2, 1e200)):
        family.add(value, place=str(place))
    assert [row.rpartition(" ")[2] for row in metrics._written(family, openmetrics=True)][2:] == ["3", "0.3", "1e+200"]
