"""The masters that poll: the C reference and the daemon, each a process with one command."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from bench.programs import HERE, MOSQUITTO_HEADER, build_reference
from bench.rows import Master, Row

BASE = "bench"
DAEMON = (str(Path(sys.executable).with_name("lfs10d")),)
AS_A_SERVICE = {"MALLOC_ARENA_MAX": "1"}
"""What systemd/lfs10d.service puts into the environment and changes what is measured."""


def daemon_configuration(row: Row, port: Path, broker: int) -> dict[str, object]:
    """Return the daemon's configuration of a row; JSON is YAML."""
    profile = row.profile if row.profile == "lfs10" else str(HERE / f"{row.profile}.yaml")
    sections = {
        "line": {"name": "line0", "port": str(port), "baudrate": row.baudrate, "realtime": row.realtime},
        "poll": {"interval": row.interval},
        "mqtt": {"host": "127.0.0.1", "port": broker, "base_topic": BASE},
        "log": {"level": "warning"},
        **row.sections,
    }
    return {**sections, "slaves": [{"id": slave, "profile": profile, **row.slave} for slave in row.ids]}


def command(master: Master, row: Row, folder: Path, port: Path, broker: int, daemon: tuple[str, ...]) -> list[str]:
    """Return the command line that polls the row's line."""
    if master == "daemon":
        configuration = folder / "line0.yaml"
        configuration.write_text(json.dumps(daemon_configuration(row, port, broker), indent=2) + "\n")
        return [*daemon, "run", "-c", str(configuration), "--state-dir", str(folder / "state")]
    publish = ["--mqtt", f"127.0.0.1:{broker}"] if MOSQUITTO_HEADER.exists() else []
    rate = str(row.baudrate)
    return [str(build_reference()), "--baudrate", rate, "--ids", f"1-{row.sensors}", *publish, str(port)]


def start(words: list[str], errors: Path) -> subprocess.Popen[str]:
    """Start a master; what it complains of goes to a file."""
    # An installed daemon finds its modules compiled.
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment = {**inherited, **AS_A_SERVICE}
    with errors.open("w") as complaints:
        return subprocess.Popen(
            words, stdout=subprocess.PIPE, stderr=complaints, text=True, cwd=HERE.parent, env=environment
        )


def scratch() -> tempfile.TemporaryDirectory[str]:
    """Return a folder for one run."""
    return tempfile.TemporaryDirectory(prefix="lfs10d-bench-")
