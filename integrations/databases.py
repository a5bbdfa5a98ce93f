"""The recipes for databases: PostgreSQL, TimescaleDB, and what Telegraf fills."""

from __future__ import annotations

import json
import os
import re
import shutil
import time
from pathlib import Path

from bench.broker import free_port
from integrations.recipes import HOLES, away, page
from integrations.rig import FILES, PLACES, Missing, Rig, program


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
        preload = ("-c", "shared_preload_libraries=timescaledb") if _timescaledb() else ()
        rig.start(*begin, postgres, "-D", str(folder / "data"), "-k", str(folder), "-h", "", *preload)
        rig.until((folder / ".s.PGSQL.5432").exists, "PostgreSQL answers")
        time.sleep(2)
        rig.call(*psql[:-1], "postgres", "-c", "CREATE DATABASE wind")
        rig.call(*psql, "-f", str(_readable(rig, "postgresql.sql")))
    return str(folder), psql


def _timescaledb() -> bool:
    return any(Path("/usr/share/postgresql").glob("*/extension/timescaledb.control"))


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


def timescaledb(rig: Rig) -> str:
    """Make the table of samples a hypertable, and copy a line's samples in twice; each is there once."""
    if not _timescaledb():
        raise Missing("TimescaleDB is not installed (Timescale's packages, or built from its source)")
    _, psql = _postgresql(rig)
    rig.call(*psql, "-c", "CREATE DATABASE hyper")
    hyper = [*psql[:-1], "hyper"]
    for name in ("postgresql.sql", "timescaledb.sql"):
        rig.call(*hyper, "-f", str(_readable(rig, name)))
    count = 5000
    rows = (
        f"SELECT to_timestamp(1796000000) + n * interval '1 minute', 'a', 'line0', 'mast', 'k1', n, 4.2, NULL, 'good', "  # noqa: S608  # a text of ours
        f"NULL, 'synced', 18.2 FROM generate_series(1, {count}) AS n"
    )
    for _ in range(2):
        rig.call(*hyper, "-c", f"INSERT INTO wind_in {rows}")
    assert rig.call(*hyper, "-c", "SELECT count(*) FROM wind") == f"{count}\n"
    rig.call(*hyper, "-f", str(_readable(rig, "postgresql-queries.sql")))
    version = rig.call(*hyper, "-c", "SELECT extversion FROM pg_extension WHERE extname = 'timescaledb'").strip()
    chunks = rig.call(*hyper, "-c", "SELECT count(*) FROM show_chunks('wind')").strip()
    rig.call(*hyper, "-c", "SELECT drop_chunks('wind', older_than => interval '1 day')")
    return f"TimescaleDB {version}: {count} samples twice are {count} rows in {chunks} chunks; the queries answer"


def _stores(rig: Rig) -> tuple[Path, dict[str, int]]:
    """Start the stores of line protocol that are installed; return Telegraf's file for them, and their ports."""
    ports: dict[str, int] = {}
    text = ""
    if influxd := shutil.which("influxd", path=PLACES):
        ports["InfluxDB"], port, folder = free_port(), free_port(), rig.folder / "influxdb"
        configuration = rig.folder / "influxdb.conf"
        configuration.write_text(
            f'reporting-disabled = true\nbind-address = "127.0.0.1:{port}"\n[meta]\ndir = "{folder}/meta"\n'
            f'[data]\ndir = "{folder}/data"\nwal-dir = "{folder}/wal"\n[http]\n'
            f'bind-address = "127.0.0.1:{ports["InfluxDB"]}"\n'
        )
        rig.start(influxd, "-config", str(configuration))
        text += f'[[outputs.influxdb]]\nurls = ["http://127.0.0.1:{ports["InfluxDB"]}"]\ndatabase = "wind"\n'
    if victoria := shutil.which("victoria-metrics", path=PLACES):
        port = ports["VictoriaMetrics"] = free_port()
        folder = rig.folder / "victoria-samples"
        rig.start(
            victoria, f"-storageDataPath={folder}", f"-httpListenAddr=127.0.0.1:{port}", "-dedup.minScrapeInterval=1ms"
        )
        text += f'[[outputs.influxdb]]\nurls = ["http://127.0.0.1:{port}"]\nskip_database_creation = true\n'
    file = rig.folder / "telegraf-stores.conf"
    file.write_text(text or "# none\n")
    return file, ports


def _stored(ports: dict[str, int]) -> dict[str, dict[str, int]]:
    """Return how many samples of each device each store has."""
    counts: dict[str, dict[str, int]] = {}
    if port := ports.get("InfluxDB"):
        query = {"db": "wind", "q": "SELECT count(seq) FROM wind_in GROUP BY device"}
        (result,) = json.loads(page(port, "/query", **query))["results"]
        counts["InfluxDB"] = {row["tags"]["device"]: row["values"][0][1] for row in result["series"]}
    if port := ports.get("VictoriaMetrics"):
        page(port, "/internal/force_flush")
        series = map(json.loads, page(port, "/api/v1/export", **{"match[]": "wind_in_seq"}).splitlines())
        counts["VictoriaMetrics"] = {each["metric"]["device"]: len(set(each["timestamps"])) for each in series}
    return counts


def telegraf(rig: Rig) -> str:
    """Fill the tables while the broker, and then Telegraf, is killed; nothing is missing or double."""
    agent = program("telegraf", "InfluxData's packages; or `go build` of github.com/influxdata/telegraf")
    folder, psql = _postgresql(rig)
    stores, ports = _stores(rig)
    environment = {
        "LFS10D_BROKER": f"tcp://127.0.0.1:{rig.broker_port}",
        "LFS10D_POSTGRESQL": f"host={folder} user=postgres dbname=wind",
    }
    command = (agent, "--config", str(FILES / "telegraf.conf"), "--config", str(stores))
    running = rig.start(*command, environment=environment, log="telegraf.log")
    away(rig)
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
    there = {device: int(count) for device, _, count in rows}
    for store, counts in _stored(ports).items():
        assert counts == there, (store, counts, there)
    also = "".join(f"; as many in {store}" for store in ports)
    return (
        f"{sum(there.values())} samples, none missing after broker and Telegraf were killed, of {len(lines)} lines of "
        f"line protocol{also}"
    )
