"""One function per recipe of docs/integrations: follows the page on the rig's line, and returns what was seen."""

from __future__ import annotations

import json
import os
import re
import shutil
import sqlite3
import sys
import time
import urllib.parse
import urllib.request
from pathlib import Path
from typing import Any, Final

from bench.broker import free_port
from integrations.rig import FILES, PLACES, Missing, Rig, program

__all__ = ["PLACES", "node_red", "postgresql", "prometheus", "python", "telegraf", "victoriametrics", "weewx"]

AWAY: Final = 15.0
"""Seconds without a broker: it answers again before its subscribers are back."""
AFTER: Final = 25.0
"""Seconds in which the past is to be in: 10 s pass before the backlog begins."""
HOLES: Final = "SELECT device, max(seq) - min(seq) + 1 - count(*), count(*) FROM wind GROUP BY device ORDER BY device"


def _away(rig: Rig) -> None:
    time.sleep(10)
    rig.kill_broker()
    time.sleep(AWAY)
    rig.start_broker()
    time.sleep(AFTER)


def _asked(port: int, query: str) -> list[Any]:
    """Return the result of a query in Prometheus' language."""
    address = f"http://127.0.0.1:{port}/api/v1/query?query={urllib.parse.quote(query)}"
    try:
        with urllib.request.urlopen(address, timeout=5) as answer:
            result: list[Any] = json.load(answer)["data"]["result"]
    except OSError:
        return []
    return result


def python(rig: Rig) -> str:
    """Run subscriber.py while the broker is killed; nothing is missing."""
    file = rig.folder / "wind.db"
    store = rig.start(sys.executable, str(FILES / "subscriber.py"), "127.0.0.1", str(rig.broker_port), str(file))
    _away(rig)
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
    running = rig.start(
        *(server, f"--config.file={folder / 'prometheus.yml'}", f"--storage.tsdb.path={folder / 'data'}"),
        f"--web.listen-address=127.0.0.1:{port}",
    )
    speed = "lfs10d_device_wind_speed_meters_per_second"
    rig.until(lambda: len(_asked(port, speed)) == 2, "two wind speeds are stored")
    alerts = 'ALERTS{alertname="WindSensorSilent",alertstate="firing",device="slave-4"}'
    rig.until(lambda: _asked(port, alerts), "the alert of the silent sensor", 120)
    rig.end(running)
    return f"Prometheus {rig.call(server, '--version').split()[2]}: rules tested, two speeds stored, slave-4 alerted"


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


def _postgresql(rig: Rig) -> tuple[str, list[str]]:
    """Start a cluster with the tables, once; return its folder and the start of each psql."""
    folder = rig.folder / "postgresql"
    begin = ["runuser", "-u", "postgres", "--"] if os.geteuid() == 0 else []
    psql = [*begin, program("psql", "Debian: postgresql"), "-qAt", "-v", "ON_ERROR_STOP=1"]
    psql += ["-h", str(folder), "-d", "wind"]
    if not folder.exists():
        bins = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
        if not bins:
            raise Missing("initdb is not installed (Debian: postgresql)")
        rig.folder.chmod(0o755)
        folder.mkdir()
        if begin:
            shutil.chown(folder, "postgres")
        rig.call(*begin, str(bins[-1]), "-D", str(folder / "data"), "-A", "trust")
        postgres = str(bins[-1].with_name("postgres"))
        rig.start(*begin, postgres, "-D", str(folder / "data"), "-k", str(folder), "-h", "")
        rig.until((folder / ".s.PGSQL.5432").exists, "PostgreSQL answers")
        time.sleep(2)
        rig.call(*psql[:-1], "postgres", "-c", "CREATE DATABASE wind")
        rig.call(*psql, "-f", str(_readable(rig, "postgresql.sql")))
    return str(folder), psql


def _readable(rig: Rig, name: str) -> Path:
    """Return a copy that another user may read."""
    copy = rig.folder / name
    copy.write_text((FILES / name).read_text())
    copy.chmod(0o644)
    return copy


def postgresql(rig: Rig) -> str:
    """Make the tables; a row that comes twice is there once, and the queries answer."""
    _, psql = _postgresql(rig)
    row = "now(), 'try', 'line0', 'mast-top', 'k1', 1, 4.2, NULL, 'good', NULL, 'synced', 18.2"
    for _ in range(2):
        rig.call(*psql, "-c", f"INSERT INTO wind_in VALUES ({row})")  # noqa: S608  # a text of ours
    assert rig.call(*psql, "-c", "SELECT count(*) FROM wind WHERE site = 'try'") == "1\n"
    rig.call(*psql, "-c", "DELETE FROM wind WHERE site = 'try'")
    rig.call(*psql, "-f", str(_readable(rig, "postgresql-queries.sql")))
    return f"PostgreSQL {rig.call(*psql, '-c', 'SHOW server_version').strip()}: a row twice is one; the queries answer"


def telegraf(rig: Rig) -> str:
    """Fill the tables while the broker, and then Telegraf, is killed; nothing is missing or double."""
    agent = program("telegraf", "InfluxData's packages; or `go build` of github.com/influxdata/telegraf")
    folder, psql = _postgresql(rig)
    environment = {
        "LFS10D_BROKER": f"tcp://127.0.0.1:{rig.broker_port}",
        "LFS10D_POSTGRESQL": f"host={folder} user=postgres dbname=wind",
    }
    command = (agent, "--config", str(FILES / "telegraf.conf"))
    running = rig.start(*command, environment=environment, log="telegraf.log")
    _away(rig)
    rig.end(running, kill=True)
    time.sleep(10)
    running = rig.start(*command, environment=environment, log="telegraf.log")
    rig.until(lambda: int(rig.call(*psql, "-c", "SELECT count(*) FROM wind_record") or 0), "a record is there", 90)
    time.sleep(5)
    rig.end(running)
    rows = [line.split("|") for line in rig.call(*psql, "-c", HOLES).splitlines()]
    assert len(rows) == 4, rows
    assert {missing for _, missing, _ in rows} == {"0"}, rows
    lines = re.findall(r"^wind_in,", (rig.folder / "telegraf.log").read_text(), re.MULTILINE)
    count = sum(int(each) for _, _, each in rows)
    return f"{count} samples, none missing after broker and Telegraf were killed; {len(lines)} lines of line protocol"


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
