"""`lfs10d watch`."""

from __future__ import annotations

import json
import re
import signal
from pathlib import Path
from typing import Any

import pytest

from tests.support.brokers import Mosquitto
from tests.support.shells import Shell, running, typed
from tests.support.sites import Site, eventually, tell


def test_watch_shows_every_slave_on_80_columns(site: Site, mosquitto: Mosquitto, shell: Shell) -> None:
    del mosquitto
    running(site)
    watching = shell.terminal("watch")
    watching.says("live from broker 127.0.0.1:")
    watching.says("Mast, 10 m")
    # Its name comes before its first value, and a gust 3 s after the start of the daemon.
    eventually(lambda: watching.read() and re.search(r"mast-top .* m/s .*good ", watching.text), "mast-top is good")
    assert watching.ends(signal.SIGINT) == 0
    last = watching.text.rpartition("line0: ")[2].splitlines()
    assert all(len(line) <= 80 for line in last)
    gust = r" +[\d.]+" if any("value gust 10m state" in line for line in last) else ""
    row = re.compile(rf"[>+ ] mast-top +2 +[\d.]+ m/s{gust} good +\d.\ds +\d+ ms Mast, 10 m *")
    assert sum(row.fullmatch(line) is not None for line in last) == 1


def test_watch_marks_the_one_that_moves(site: Site, mosquitto: Mosquitto, shell: Shell) -> None:
    """On the line of these tests every value is another; a second sensor stands still."""
    del mosquitto
    served = site.line((1, 2))
    site.write(slaves=[1, {"id": 2, "name": "spun"}], poll={"interval": "100ms"})

    def calm(line: Any) -> None:  # noqa: ANN401 - the simulated line
        for sensor in line.sensors:
            if sensor.slave == 1:
                sensor.source = lambda *_: 5.0

    tell(served, calm)
    site.run().ready()
    watching = shell.pipe("watch")
    watching.says("spun  2")
    watching.says("moved")
    assert watching.ends(signal.SIGTERM) == 0
    marked = {line.split("  ")[1] for line in watching.text.splitlines() if line.endswith("moved")}
    assert marked == {"spun"}


def test_watch_in_a_pipe_is_one_line_for_each_new_value(site: Site, mosquitto: Mosquitto, shell: Shell) -> None:
    del mosquitto
    running(site)
    watching = shell.pipe("watch")
    watching.says("mast-top")
    before = len(watching.text)
    watching.says("mast-top", since=before)
    assert watching.ends(signal.SIGINT) == 0
    assert "\x1b" not in watching.text
    heading, source, *lines = watching.text.splitlines()
    assert heading.startswith("# line0: ")
    assert source.startswith("# live from broker")
    assert all(re.match(r"[-\d]+ [\d:.]+ [A-Z]+  (slave-1|mast-top)  \d  ", line) for line in lines)


def test_watch_for_programs_is_one_object_for_each_new_value(site: Site, mosquitto: Mosquitto, shell: Shell) -> None:
    del mosquitto
    running(site)
    watching = shell.pipe("watch", "--json")
    watching.says('"device": "mast-top"')
    assert watching.ends(signal.SIGTERM) == 0
    told = [json.loads(line) for line in watching.text.splitlines()]
    assert {one["device"] for one in told} <= {"slave-1", "mast-top"}
    assert all(one["live"] is True for one in told if one["state"] == "good")


def test_without_a_broker_watch_shows_the_status_file_and_says_so(site: Site, shell: Shell) -> None:
    site.line()
    site.write()
    run = site.run()
    run.ready()
    eventually(run.status.exists, "the status file")
    watching = shell.pipe("watch", runtime=run.status.parent)
    watching.says(f"# live from {run.status} (broker 127.0.0.1:{site.port}: connection refused")
    watching.says("slave-2  2")
    assert watching.ends(signal.SIGINT) == 0


def test_when_the_broker_goes_watch_goes_on_from_the_status_file_and_comes_back(
    site: Site, mosquitto: Mosquitto, shell: Shell
) -> None:
    run = running(site)
    watching = shell.pipe("watch", runtime=run.status.parent)
    watching.says("# live from broker")
    mosquitto.kill()
    before = len(watching.text)
    watching.says(f"# live from {run.status}", since=before)
    mosquitto.start()
    before = len(watching.text)
    watching.says("# live from broker", since=before)
    assert watching.ends(signal.SIGINT) == 0


def test_when_the_daemon_goes_what_is_shown_is_called_old(site: Site, mosquitto: Mosquitto, shell: Shell) -> None:
    del mosquitto
    run = running(site)
    watching = shell.pipe("watch", runtime=run.status.parent)
    watching.says("mast-top  2")
    run.process.kill()
    watching.says("# NOT LIVE")
    watching.says("old value  last value")
    shown = watching.text.rpartition("# NOT LIVE")[2]
    assert "good" not in shown
    assert watching.ends(signal.SIGINT) == 0


def test_watch_without_broker_and_status_file_ends_with_69(site: Site) -> None:
    site.write()
    done = typed(site, "watch")
    assert done.returncode == 69
    assert "connection refused" in done.stderr
    assert "no daemon on this machine has written its status to /run/lfs10d/status.json" in done.stderr


def test_watch_at_a_broker_that_knows_no_daemon_ends_with_69(site: Site, mosquitto: Mosquitto) -> None:
    del mosquitto
    site.write()
    done = typed(site, "watch")
    assert done.returncode == 69
    assert "no daemon has ever published at lfs10d/line0" in done.stderr


@pytest.mark.parametrize("content", ["", "nonsense", "[]", "{}", '{"line":{"name":"line1"},"devices":[]}', "[" * 5000])
def test_a_status_file_that_is_not_our_line_s_is_none(site: Site, tmp_path: Path, content: str) -> None:
    site.write()
    (tmp_path / "status.json").write_text(content)
    assert typed(site, "watch", runtime=tmp_path).returncode == 69
