"""telegraf.conf and the tables of postgresql.sql fit what the daemon publishes; Telegraf is too large for CI.

`fields` does what Telegraf's parser for JSON does with these settings; `make integrations` runs Telegraf itself.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import pytest

from docs.generate.contract import OUTBOUND
from docs.generate.wind_payloads import RecordPayload
from lfs10d.reading import FaultCode
from lfs10d.telemetry.publication import Sample
from tests.support.samples import SAMPLE

FILES = Path(__file__).parents[2] / "config" / "integrations"
CONFIGURATION: Final[dict[str, Any]] = tomllib.loads((FILES / "telegraf.conf").read_text(encoding="utf-8"))
SAMPLES, RECORDS = CONFIGURATION["inputs"]["mqtt_consumer"]
(POSTGRESQL,) = CONFIGURATION["outputs"]["postgresql"]
TABLES = (FILES / "postgresql.sql").read_text(encoding="utf-8")
OF_TELEGRAF = {"time", "site"}
"""Columns that come from the message's time and topic."""
NUMBERS = {"double precision", "bigint", "integer"}

RECORD: Final[dict[str, object]] = {
    "v": 1, "line": "line0", "device": "mast-top", "boot": "k3f9a2c7", "seq": 3, "ts": 1795298400000,
    "time": "2026-11-21T22:00:00.000Z", "clock": "synced", "unit": "m/s", "from": 1795297800000, "to": 1795298400000,
    "mean": 5.1, "gust": 9.9, "gust_ts": 1795298000000, "lull": 2.1, "lull_ts": 1795298100000, "max": 10.4,
    "stddev": 1.2, "samples": 600, "coverage": 0.998, "direction": 270, "direction_stddev": 11.3, "historical": True,
}  # fmt: skip
EMPTY = RECORD | dict.fromkeys(("mean", "gust", "gust_ts", "lull", "lull_ts", "max", "stddev")) | {"coverage": 0.0}

STATION = replace(
    SAMPLE,
    names=("wind_speed", "wind_direction", "humidity"),
    units={"wind_speed": "m/s", "wind_direction": "°", "humidity": "%"},
    values={"wind_speed": 12.34, "wind_direction": 270, "humidity": None},
    quality="partial",
    errors={"humidity": FaultCode.UNAVAILABLE},
)
FAILED = replace(SAMPLE, values=None, quality="bad", error="timeout", rtt_ms=None)


def columns(table: str) -> dict[str, str]:
    """Return a table's columns with their types and what is said behind them."""
    found = re.search(rf"CREATE TABLE {table} \((.*?)\n\);", TABLES, re.DOTALL)
    assert found is not None
    text = re.sub(r"--.*|PRIMARY KEY \(.*", "", found[1])
    parts = (each.strip().partition(" ") for each in text.split(","))
    return {name.strip('"'): kind for name, _, kind in parts if name}


def fields(settings: Mapping[str, Any], payload: Mapping[str, object]) -> Iterator[tuple[str, object]]:
    """Yield the fields and tags that Telegraf makes of one object: numbers, and the texts that it was told to keep."""
    for key, value in payload.items():
        if isinstance(value, Mapping):
            yield from fields(settings, {f"{key}_{name}": each for name, each in value.items()})
        elif isinstance(value, bool) or value is None:
            continue
        elif isinstance(value, int | float) or key in (*settings["json_string_fields"], *settings["tag_keys"]):
            yield key, value


def row(settings: Mapping[str, Any], payload: Mapping[str, object]) -> dict[str, object]:
    """Return the row that comes into the table for one object of the topic."""
    kept = {*POSTGRESQL["fieldinclude"], *settings["tag_keys"]}
    return {key: value for key, value in fields(settings, payload) if key in kept}


def test_it_subscribes_to_what_is_stored_and_to_nothing_that_may_come_twice_without_a_key() -> None:
    assert [topic.rsplit("/", 1)[1] for topic in (*SAMPLES["topics"], *RECORDS["topics"])] == [
        "telemetry",
        "history",
        "record",
    ]
    published = {each.topic for each in OUTBOUND}
    for topic in (*SAMPLES["topics"], *RECORDS["topics"]):
        assert topic.startswith("lfs10d/+/")
        assert topic.removeprefix("lfs10d/+/") in published


@pytest.mark.parametrize("settings", [SAMPLES, RECORDS], ids=["samples", "records"])
def test_the_broker_keeps_what_comes_while_telegraf_is_away(settings: Mapping[str, Any]) -> None:
    assert settings["qos"] == 1
    assert settings["persistent_session"] is True
    assert settings["client_id"]
    assert SAMPLES["client_id"] != RECORDS["client_id"]


@pytest.mark.parametrize("settings", [SAMPLES, RECORDS], ids=["samples", "records"])
def test_the_time_is_that_of_the_measurement_and_the_site_that_of_the_topic(settings: Mapping[str, Any]) -> None:
    assert (settings["json_time_key"], settings["json_time_format"]) == ("ts", "unix_ms")
    assert settings["tag_keys"] == ["line", "device"]
    (parsing,) = settings["topic_parsing"]
    levels, names = parsing["topic"].split("/"), parsing["tags"].split("/")
    assert len(levels) == len(names) == 5
    assert names == ["site", "_", "_", "_", "_"]


@pytest.mark.parametrize(
    ("settings", "table", "payload"),
    [
        (SAMPLES, "wind", SAMPLE.payload("line0")),
        (SAMPLES, "wind", SAMPLE.payload("line0", historical=True)),
        (SAMPLES, "wind", STATION.payload("line0")),
        (SAMPLES, "wind", FAILED.payload("line0")),
        (RECORDS, "wind_record", RECORD),
        (RECORDS, "wind_record", EMPTY),
    ],
    ids=["good", "history", "partial", "bad", "record", "empty record"],
)
def test_every_payload_fits_its_table(settings: Mapping[str, Any], table: str, payload: Mapping[str, object]) -> None:
    staged, kept = columns(f"{table}_in"), columns(table)
    assert settings["name_override"] == f"{table}_in"
    values = row(settings, payload)
    for name, value in values.items():
        assert name in staged, f"PostgreSQL refuses the row: there is no column {name}"
        assert (staged[name] in NUMBERS) == isinstance(value, int | float), name
    there = {("begins" if name == "from" else name) for name in values} | OF_TELEGRAF
    demanded = {name for name, kind in kept.items() if "NOT NULL" in kind}
    assert demanded <= there, f"PostgreSQL refuses the row: {demanded - there} is null"


def test_a_record_is_as_the_model_says() -> None:
    for payload in (RECORD, EMPTY):
        RecordPayload.model_validate(payload)


@pytest.mark.parametrize(
    ("sample", "expected"),
    [
        (SAMPLE, {"wind_speed": 12.34, "quality": "good"}),
        (STATION, {"wind_speed": 12.34, "wind_direction": 270, "quality": "partial"}),
        (FAILED, {"quality": "bad", "error": "timeout"}),
    ],
    ids=["good", "partial", "bad"],
)
def test_a_null_is_absent_and_the_values_beside_it_are_there(sample: Sample, expected: dict[str, object]) -> None:
    values = row(SAMPLES, sample.payload("line0"))
    of_interest = {"wind_speed", "wind_direction", "humidity", "quality", "error"}
    assert {key: value for key, value in values.items() if key in of_interest} == expected


@pytest.mark.parametrize("table", ["wind", "wind_record"])
def test_a_row_is_kept_once_by_boot_and_seq_and_the_staging_table_stays_empty(table: str) -> None:
    assert re.search(
        rf"CREATE TABLE {table} \(.*?PRIMARY KEY \(site, line, device, boot, seq\)\n\);", TABLES, re.DOTALL
    )
    function = re.search(rf"CREATE FUNCTION {table}_once\(\).*?END \$\$;", TABLES, re.DOTALL)
    assert function is not None
    assert f"INSERT INTO {table} VALUES" in function[0]
    assert "ON CONFLICT DO NOTHING" in function[0]
    assert "RETURN NULL" in function[0]
    inserted = [each.strip() for each in re.findall(r"NEW\.\"?(\w+)", function[0])]
    assert ["begins" if name == "from" else name for name in inserted] == list(columns(table)), (
        "the order of the columns"
    )
    assert f"BEFORE INSERT ON {table}_in FOR EACH ROW EXECUTE FUNCTION {table}_once()" in TABLES


def test_every_column_is_filled() -> None:
    asked = {*POSTGRESQL["fieldinclude"], *SAMPLES["tag_keys"], *OF_TELEGRAF}
    assert {*columns("wind_in"), *columns("wind_record_in")} == asked


def test_the_hypertable_has_the_same_key_and_its_time() -> None:
    text = (FILES / "timescaledb.sql").read_text(encoding="utf-8")
    assert "ADD PRIMARY KEY (site, line, device, boot, seq, time)" in text
    assert "create_hypertable('wind', 'time'" in text
