"""The files in config/integrations fit what the daemon and the page publish."""

from __future__ import annotations

import importlib.util
import json
import re
import sqlite3
from pathlib import Path

import pytest

from docs.generate.contract import OUTBOUND
from docs.generate.dashboard import PANELS, WIDTH, Panel, page, placed

ROOT = Path(__file__).parents[2]
FILES = ROOT / "config" / "integrations"
METRICS = (ROOT / "lfs10d" / "web" / "metrics.py").read_text(encoding="utf-8")
WIND_SPEED = "lfs10d_device_wind_speed_meters_per_second"
TOPICS = {row.topic for row in OUTBOUND}


def known(metric: str) -> bool:
    """Whether the page gives this metric; counters are named there without their ending."""
    name = metric.removesuffix("_total")
    return (
        metric == WIND_SPEED
        or f'"{name}"' in METRICS
        or f'"{{_DEVICE}}{name.removeprefix("lfs10d_device")}"' in METRICS
    )


@pytest.mark.parametrize("panel", PANELS, ids=lambda panel: panel.title)
def test_every_query_of_the_dashboard_asks_for_metrics_that_exist(panel: Panel) -> None:
    for expression, legend in panel.queries:
        names = re.findall(r"lfs10d_\w+", expression)
        assert names
        assert [name for name in names if not known(name)] == []
        assert expression.count("{") == expression.count("}")
        assert "{{" in legend


def test_the_panels_of_the_dashboard_neither_overlap_nor_leave_the_grid() -> None:
    taken: set[tuple[int, int]] = set()
    for _, place in placed(PANELS):
        cells = {
            (x, y)
            for x in range(place["x"], place["x"] + place["w"])
            for y in range(place["y"], place["y"] + place["h"])
        }
        assert not cells & taken
        assert place["x"] + place["w"] <= WIDTH
        taken |= cells


def test_the_dashboard_draws_no_line_through_a_gap_and_its_ids_are_unique() -> None:
    panels = json.loads(page())["panels"]
    drawn = [panel for panel in panels if panel["type"] == "timeseries"]
    assert {panel["fieldConfig"]["defaults"]["custom"]["spanNulls"] for panel in drawn} == {False}
    assert len({panel["id"] for panel in panels}) == len(panels) == len(PANELS)


def test_every_alert_asks_for_metrics_that_exist_and_has_a_test() -> None:
    rules = (FILES / "prometheus-alerts.yml").read_text(encoding="utf-8")
    tested = (FILES / "prometheus-alerts-test.yml").read_text(encoding="utf-8")
    assert [name for name in set(re.findall(r"lfs10d_\w+", rules)) if not known(name)] == []
    alerts = re.findall(r"- alert: (\w+)", rules)
    assert [alert for alert in alerts if f"alertname: {alert}" not in tested] == ["WindFiguresMissing"]


def test_telegraf_subscribes_to_topics_that_exist() -> None:
    text = (FILES / "telegraf.conf").read_text(encoding="utf-8")
    topics = re.findall(r'"lfs10d/\+/device/\+/(\w+)"', text)
    assert topics == ["telemetry", "history", "record"]
    assert {f"device/+/{topic}" for topic in topics} <= TOPICS


def test_the_nodes_of_the_flow_are_wired_to_nodes_that_exist() -> None:
    nodes = json.loads((FILES / "node-red-flow.json").read_text(encoding="utf-8"))
    ids = {node["id"] for node in nodes}
    assert len(ids) == len(nodes)
    assert {wire for node in nodes for output in node.get("wires", ()) for wire in output} <= ids
    assert {node["broker"] for node in nodes if node["type"].startswith("mqtt ")} == {"lfs10d-broker"}
    subscribed = {node["topic"] for node in nodes if node["type"] == "mqtt in"}
    assert subscribed == {"lfs10d/+/device/+/state", "lfs10d/+/device/+/wind", "lfs10d/line0/response/#"}


def test_the_subscriber_keeps_a_sample_once_however_often_it_comes() -> None:
    spec = importlib.util.spec_from_file_location("subscriber", FILES / "subscriber.py")
    assert spec is not None
    assert spec.loader is not None
    subscriber = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(subscriber)
    sample = {"line": "line0", "device": "mast", "boot": "k1", "seq": 1, "ts": 5, "wind_speed": None, "quality": "bad"}
    database = sqlite3.connect(":memory:")
    database.execute(subscriber.TABLE)
    for topic, content in (
        ("lfs10d/line0/device/mast/telemetry", sample),
        ("lfs10d/line0/device/mast/history", [sample, {**sample, "seq": 2}]),
        ("acme/gw7/line0/device/mast/telemetry", sample),
    ):
        rows = subscriber.rows(topic, json.dumps(content))
        database.executemany("INSERT OR IGNORE INTO wind VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", rows)
    stored = database.execute("SELECT base, device, seq, wind_speed FROM wind ORDER BY base, seq").fetchall()
    database.close()
    assert stored == [("acme/gw7", "mast", 1, None), ("lfs10d", "mast", 1, None), ("lfs10d", "mast", 2, None)]
