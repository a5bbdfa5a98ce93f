"""One function per recipe of docs/integrations: follows the page on the rig's line, and returns what was seen.

The databases have a module of their own.
"""

from __future__ import annotations

import json
import re
import sqlite3
import subprocess
import sys
import time
import urllib.parse
import urllib.request
from pathlib import Path
from typing import Any, Final

from bench.broker import free_port
from integrations.rig import FILES, PLACES, Rig, program

__all__ = [
    "PLACES",
    "grafana",
    "node_red",
    "prometheus",
    "python",
    "victoriametrics",
    "weewx",
]

AWAY: Final = 15.0
"""Seconds without a broker: it answers again before its subscribers are back."""
AFTER: Final = 25.0
"""Seconds in which the past is to be in: 10 s pass before the backlog begins."""
HOLES: Final = "SELECT device, max(seq) - min(seq) + 1 - count(*), count(*) FROM wind GROUP BY device ORDER BY device"


def away(rig: Rig) -> None:
    """Kill the broker for a while, and wait until the past is in."""
    time.sleep(10)
    rig.kill_broker()
    time.sleep(AWAY)
    rig.start_broker()
    time.sleep(AFTER)


def page(port: int, path: str, **query: str) -> str:
    """Return what a server of ours answers."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}?{urllib.parse.urlencode(query)}", timeout=5) as answer:
        text: str = answer.read().decode()
    return text


def _asked(port: int, query: str) -> list[Any]:
    """Return the result of a query in Prometheus' language; nothing while the server does not answer."""
    try:
        result: list[Any] = json.loads(page(port, "/api/v1/query", query=query))["data"]["result"]
    except OSError:
        return []
    return result


def python(rig: Rig) -> str:
    """Run subscriber.py while the broker is killed; nothing is missing."""
    file = rig.folder / "wind.db"
    store = rig.start(sys.executable, str(FILES / "subscriber.py"), "127.0.0.1", str(rig.broker_port), str(file))
    away(rig)
    rig.end(store)
    database = sqlite3.connect(file)
    rows = database.execute(HOLES).fetchall()
    database.close()
    assert len(rows) == 4, rows
    assert {missing for _, missing, _ in rows} == {0}, rows
    return f"{sum(count for _, _, count in rows)} samples, none missing after {AWAY:g} s without a broker"


def _scrape(rig: Rig) -> Path:
    folder = rig.folder / "prometheus"
    folder.mkdir(exist_ok=True)
    for each in FILES.glob("prometheus*.yml"):
        (folder / each.name).write_text(each.read_text().replace("127.0.0.1:8073", f"127.0.0.1:{rig.page_port}"))
    return folder


def prometheus(rig: Rig) -> str:
    """Test the rules, and store what the page shows."""
    server, promtool = program("prometheus", "Debian"), program("promtool", "Debian: prometheus")
    folder, port = _scrape(rig), free_port()
    rig.call(promtool, "test", "rules", str(folder / "prometheus-alerts-test.yml"))
    rig.call(promtool, "check", "config", str(folder / "prometheus.yml"))
    running = _prometheus(rig, server, folder, port)
    alerts = 'ALERTS{alertname="WindSensorSilent",alertstate="firing",device="slave-4"}'
    rig.until(lambda: _asked(port, alerts), "the alert of the silent sensor", 120)
    rig.end(running)
    return f"Prometheus {rig.call(server, '--version').split()[2]}: rules tested, two speeds stored, slave-4 alerted"


def _prometheus(rig: Rig, server: str, folder: Path, port: int) -> subprocess.Popen[bytes]:
    """Start a Prometheus and wait until it has two wind speeds."""
    running = rig.start(
        *(server, f"--config.file={folder / 'prometheus.yml'}", f"--storage.tsdb.path={folder / f'data-{port}'}"),
        f"--web.listen-address=127.0.0.1:{port}",
    )
    speed = "lfs10d_device_wind_speed_meters_per_second"
    rig.until(lambda: len(_asked(port, speed)) == 2, "two wind speeds are stored")
    return running


def grafana(rig: Rig) -> str:
    """Ask Prometheus every query of the dashboard, as Grafana would with all lines and sensors chosen."""
    folder, port = _scrape(rig), free_port()
    running = _prometheus(rig, program("prometheus", "Debian"), folder, port)
    dashboard = json.loads((FILES / "grafana-dashboard.json").read_text())
    answers = 0
    for panel in dashboard["panels"]:
        for target in panel["targets"]:
            query = target["expr"].replace("$line", ".+").replace("$device", ".+")
            rig.until(lambda query=query: _asked(port, query), f"{panel['title']}: {query}", 120)  # type: ignore[misc]  # a default
            rows = _asked(port, query)
            answers += len(rows)
            if panel["type"] == "stat":
                assert {row["metric"]["device"] for row in rows} == {"slave-2", "mast-top"}, rows
    for choice in dashboard["templating"]["list"][1:]:
        found = re.fullmatch(r"label_values\((.*), (\w+)\)", choice["query"]["query"])
        assert found, choice
        match = {"match[]": found[1].replace("$line", ".+")}
        values = json.loads(page(port, f"/api/v1/label/{found[2]}/values", **match))["data"]
        assert values, choice
    rig.end(running)
    return (
        f"Prometheus answers the {len(dashboard['panels'])} panels with {answers} series (Grafana itself was not run)"
    )


def victoriametrics(rig: Rig) -> str:
    """Store what the page shows."""
    server = program("victoria-metrics", "Debian")
    folder, port = _scrape(rig), free_port()
    running = rig.start(
        *(server, f"-promscrape.config={folder / 'prometheus.yml'}", "-promscrape.config.strictParse=false"),
        *(f"-storageDataPath={rig.folder / 'victoria'}", f"-httpListenAddr=127.0.0.1:{port}"),
    )
    # What is newer than 30 s it does not show by itself.
    query = "last_over_time(lfs10d_device_wind_speed_meters_per_second[5m])"
    rig.until(lambda: len(_asked(port, query)) == 2, "two wind speeds are stored", 120)
    rig.end(running)
    return "two speeds stored"


def weewx(rig: Rig) -> str:
    """Install the extension and run until an archive record has speed, gust and direction."""
    weectl, weewxd = (program(name, "PyPI: weewx and paho-mqtt") for name in ("weectl", "weewxd"))
    home = rig.folder / "weewx"
    environment = {"HOME": str(rig.folder)}
    rig.call(weectl, "station", "create", str(home), "--no-prompt", environment=environment)
    file = home / "weewx.conf"
    extension = str(FILES / "weewx")
    rig.call(weectl, "extension", "install", extension, "--yes", f"--config={file}", environment=environment)
    text = re.sub(r"station_type = \w+", "station_type = Lfs10d", file.read_text())
    text = re.sub(r"archive_interval = \d+", "archive_interval = 60", text)
    section = f"port = {rig.broker_port}\n    topic = lfs10d/line0\n    anemometer = mast-top\n    vane = vane"
    text, changed = re.subn(r"port = 1883\n +topic = .*\n +anemometer = .*\n +vane = .*", section, text)
    assert changed, "the extension's section is not in weewx.conf"
    file.write_text(text)
    running = rig.start(weewxd, f"--config={file}", environment=environment, log="weewx.log")

    def record() -> Any:  # noqa: ANN401  # a row of SQLite
        try:
            database = sqlite3.connect(home / "archive" / "weewx.sdb")
            found = database.execute(
                "SELECT windSpeed * 0.44704, windGust * 0.44704, windDir FROM archive WHERE windDir IS NOT NULL"
            ).fetchone()
            database.close()
        except sqlite3.Error:
            return None
        return found

    rig.until(record, "an archive record with a direction", 180)
    rig.end(running)
    speed, gust, direction = record()
    assert 0 < speed <= gust < 40, (speed, gust)
    return f"an archive record: {speed:.1f} m/s, gust {gust:.1f} m/s, {direction:.0f} degrees"


def node_red(rig: Rig) -> str:
    """Import the flow and run until table, alarm and response were seen."""
    server = program("node-red", "npm: node-red")
    home = rig.folder / "node-red"
    home.mkdir()
    flow = json.loads((FILES / "node-red-flow.json").read_text())
    for node in flow:
        if node["type"] == "mqtt-broker":
            node["port"] = str(rig.broker_port)
        if node["type"] == "debug":
            node["console"] = True
    (home / "flow.json").write_text(json.dumps(flow))
    (home / "settings.js").write_text(
        f'module.exports = {{uiPort: {free_port()}, uiHost: "127.0.0.1", telemetry: {{enabled: false}}}};'
    )
    running = rig.start(
        *(server, "-u", str(home), "-s", str(home / "settings.js"), str(home / "flow.json")), log="node-red.log"
    )
    log = rig.folder / "node-red.log"
    for node in ("table", "response", "alarm"):
        rig.until(lambda node=node: f"[debug:{node}]" in log.read_text(), f"{node} of Node-RED", 180)  # type: ignore[misc]  # a default
    rig.end(running)
    assert "[error]" not in log.read_text(), log.read_text()[-400:]
    return "table, response and alarm seen"
