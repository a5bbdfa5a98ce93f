"""The Grafana dashboard config/integrations/grafana-dashboard.json, for the figures that `lfs10d web` gives Prometheus.

Panels are data here; `python -m docs.generate` writes the file.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

WIDTH: Final = 24
"""Columns of Grafana's grid."""
_SOURCE: Final = {"type": "prometheus", "uid": "${source}"}
_LINES: Final = '{line=~"$line"}'
_DEVICES: Final = '{line=~"$line",device=~"$device"}'


@dataclass(frozen=True, slots=True)
class Panel:
    """One panel: its queries with the legend of each, and its place in a row."""

    title: str
    kind: str
    queries: tuple[tuple[str, str], ...]
    width: int
    height: int = 8
    unit: str = "none"
    thresholds: tuple[tuple[float | None, str], ...] = ((None, "green"),)
    description: str = ""
    words: tuple[tuple[str, str], ...] = ()
    """What is shown in place of a number, as in (("0", "silent"),)."""


PANELS: Final = (
    Panel(
        "Wind now",
        "stat",
        ((f"lfs10d_device_wind_speed_meters_per_second{_DEVICES}", "{{device}}"),),
        WIDTH,
        5,
        "velocityms",
        ((None, "green"), (15, "orange"), (20, "red")),
        "The value of this moment: a sensor without one is not there.",
    ),
    Panel(
        "Wind speed",
        "timeseries",
        ((f"lfs10d_device_wind_speed_meters_per_second{_DEVICES}", "{{device}}"),),
        WIDTH,
        10,
        "velocityms",
        description="A gap is a time without a value: it is never drawn through.",
    ),
    Panel(
        "Greatest value of 10 minutes",
        "timeseries",
        ((f"max_over_time(lfs10d_device_wind_speed_meters_per_second{_DEVICES}[10m])", "{{device}}"),),
        12,
        unit="velocityms",
        description="Of the values scraped. The gust of WMO is in the topic `wind`.",
    ),
    Panel(
        "Sensors that answer",
        "state-timeline",
        ((f"lfs10d_device_online{_DEVICES}", "{{device}}"),),
        12,
        thresholds=((None, "red"), (1, "green")),
        words=(("0", "silent"), ("1", "answers")),
    ),
    Panel(
        "Failed polls",
        "timeseries",
        ((f"sum by (device, code) (rate(lfs10d_device_poll_errors_total{_DEVICES}[5m]))", "{{device}} {{code}}"),),
        12,
        unit="cps",
    ),
    Panel(
        "Response time (95 %)",
        "timeseries",
        (('lfs10d_device_response_seconds{line=~"$line",device=~"$device",quantile="0.95"}', "{{device}}"),),
        12,
        unit="s",
    ),
    Panel(
        "Load of the line",
        "timeseries",
        ((f"lfs10d_line_load_ratio{_LINES}", "{{line}}"),),
        8,
        unit="percentunit",
        thresholds=((None, "green"), (0.95, "red")),
    ),
    Panel("Samples waiting", "timeseries", ((f"lfs10d_store_samples{_LINES}", "{{line}}"),), 8),
    Panel(
        "Broker",
        "state-timeline",
        ((f"lfs10d_mqtt_connected{_LINES}", "{{line}}"),),
        8,
        thresholds=((None, "red"), (1, "green")),
        words=(("0", "away"), ("1", "connected")),
    ),
)


def placed(panels: tuple[Panel, ...]) -> Iterator[tuple[Panel, Mapping[str, int]]]:
    """Yield each panel with its place in the grid, row by row."""
    left = top = height = 0
    for panel in panels:
        if left + panel.width > WIDTH:
            left, top, height = 0, top + height, 0
        yield panel, {"x": left, "y": top, "w": panel.width, "h": panel.height}
        left, height = left + panel.width, max(height, panel.height)


def _panel(number: int, panel: Panel, place: Mapping[str, int]) -> dict[str, Any]:
    steps = [{"value": value, "color": color} for value, color in panel.thresholds]
    defaults: dict[str, Any] = {"unit": panel.unit, "thresholds": {"mode": "absolute", "steps": steps}}
    if panel.words:
        words = {value: {"text": text, "index": n} for n, (value, text) in enumerate(panel.words)}
        defaults["mappings"] = [{"type": "value", "options": words}]
    if panel.kind == "timeseries":
        defaults["custom"] = {"spanNulls": False, "lineWidth": 1, "fillOpacity": 5}
    return {
        "id": number,
        "type": panel.kind,
        "title": panel.title,
        "description": panel.description,
        "datasource": _SOURCE,
        "gridPos": place,
        "fieldConfig": {"defaults": defaults, "overrides": []},
        "options": {},
        "targets": [
            {
                "refId": chr(ord("A") + n),
                "datasource": _SOURCE,
                "expr": expression,
                "legendFormat": legend,
                # A stat shows the last value it gets: of a range that would be an old one, shown as if it were new.
                "instant": panel.kind == "stat",
                "range": panel.kind != "stat",
            }
            for n, (expression, legend) in enumerate(panel.queries)
        ],
    }


def _choice(name: str, query: str) -> dict[str, Any]:
    return {
        "name": name,
        "label": name.capitalize(),
        "type": "query",
        "datasource": _SOURCE,
        "query": {"query": query, "refId": name},
        "refresh": 2,
        "multi": True,
        "includeAll": True,
        "current": {"text": ["All"], "value": ["$__all"]},
    }


def page() -> str:
    """Return the file's content."""
    dashboard = {
        "uid": "lfs10d",
        "title": "Wind (lfs10d)",
        "tags": ["lfs10d", "wind"],
        "schemaVersion": 39,
        "version": 1,
        "editable": True,
        "refresh": "10s",
        "time": {"from": "now-1h", "to": "now"},
        "templating": {
            "list": [
                {"name": "source", "label": "Data source", "type": "datasource", "query": "prometheus"},
                _choice("line", "label_values(lfs10d_mqtt_connected, line)"),
                _choice("device", 'label_values(lfs10d_device_online{line=~"$line"}, device)'),
            ]
        },
        "panels": [_panel(number, panel, place) for number, (panel, place) in enumerate(placed(PANELS), 1)],
    }
    return json.dumps(dashboard, indent=2) + "\n"
