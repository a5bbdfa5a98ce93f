"""What the service manager is told, and `status.json`."""

from __future__ import annotations

import json
import re
import signal
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from lfs10d.simulator.faults import FaultKind
from tests.support.faulty_sensors import add_fault
from tests.support.sites import Run, Site, View, eventually, good

START = "from lfs10d.__main__ import main; main()"

LINE_WEDGES = f"""
import time
from lfs10d.line.poller import Poller
turn = Poller.turn
def wedge(self, now, **more):
    if self.bus.open and now > begun + 1:
        while True:
            time.sleep(1)
    return turn(self, now, **more)
begun = time.monotonic()
Poller.turn = wedge
{START}
"""

LOOP_WEDGES = f"""
import asyncio, time
from lfs10d.daemon import daemon
run = daemon.run
async def wedge(*given):
    asyncio.get_running_loop().call_later(1.5, stand_still)
    return await run(*given)
def stand_still():
    while True:
        time.sleep(1)
daemon.run = wedge
{START}
"""

LINE_ENDS = f"""
from lfs10d.line.poller import Poller
def fail(self, now, **more):
    raise LookupError("no such thing")
Poller.turn = fail
{START}
"""

CLOCK_STEPS = f"""
import time
real, begun = time.time, time.monotonic()
time.time = lambda: real() + (86_400 if time.monotonic() > begun + 3 else 0)
{START}
"""
"""Programs in which something goes wrong that cannot be made to from outside."""

WATCHDOG = 3.0
"""s; the daemon feeds three times in it."""


def fed(run: Run) -> list[float]:
    """Return when the watchdog was fed."""
    return [at for at, line in list(run.manager.told) if line == "WATCHDOG=1"]


def test_ready_comes_after_the_first_exchange(site: Site) -> None:
    served = site.line((1,))
    add_fault(served.line.sensor(1), FaultKind.SILENT)
    site.write(slaves=[{"id": 1, "response_timeout": "1500ms"}])
    run = site.run()
    eventually(served.line.judge.counts.total, "a request")
    asked = time.monotonic()
    run.ready()

    ready = next(at for at, line in run.manager.told if line == "READY=1")
    assert ready - asked > 1.0


@pytest.mark.parametrize("slaves", [[], [{"id": 1, "enabled": False}]], ids=["none", "disabled"])
def test_ready_comes_at_once_where_nothing_is_to_be_polled(site: Site, slaves: list[Any]) -> None:
    site.line()
    site.write(slaves=slaves)

    site.run().ready()


def test_the_status_tells_slaves_and_broker(site: Site, view: View) -> None:
    site.line()
    site.write()
    run = site.run()
    view.wait("device/slave-1/state", good)

    eventually(
        lambda: [one for one in run.manager.all("STATUS=") if re.search(r"2 of 2 .*online.*broker connected", one)],
        "the status",
    )
    eventually(lambda: [one for one in run.manager.all("STATUS=") if "% busy" in one], "the load")


def test_a_reload_is_announced_with_its_time_and_ended_even_if_the_file_is_broken(site: Site) -> None:
    site.write(slaves=[])
    run = site.run()
    run.ready()
    site.file.write_text("line: [")

    before = time.monotonic()
    run.reload()

    told = [line for _, line in run.manager.told]
    begun = told.index("RELOADING=1")
    stamp = int(told[begun + 1].removeprefix("MONOTONIC_USEC="))
    assert before * 1e6 <= stamp <= time.monotonic() * 1e6
    assert "READY=1" in told[begun:]


@pytest.mark.long(10)
def test_nothing_that_is_merely_absent_or_idle_ever_starves_the_watchdog(site: Site, tmp_path: Path) -> None:
    site.line((1, 2))
    idle = tmp_path / "idle.yaml"
    site.write(slaves=[{"id": 1, "interval": "24h"}])
    site.file.rename(idle)
    empty = tmp_path / "empty.yaml"
    site.write(slaves=[], line={"port": "/dev/null"})
    site.file.rename(empty)
    absent = tmp_path / "absent.yaml"
    site.write(line={"port": str(tmp_path / "absent")})
    site.file.rename(absent)
    site.write(line={"port": str(tmp_path / "absent-too")})

    runs = [
        site.run("-c", str(file), "--state-dir", str(tmp_path / file.stem), watchdog=WATCHDOG)
        for file in (idle, empty, absent)
    ]
    runs.append(site.run(program=("-c", CLOCK_STEPS), watchdog=WATCHDOG))
    eventually(lambda: all(fed(run) for run in runs), "all have begun to feed")
    time.sleep(8)  # longer than the longest idle wait of the line's thread

    for run in runs:
        assert run.process.poll() is None
        times = [*fed(run), time.monotonic()]
        assert len(times) > 4
        assert max(later - earlier for earlier, later in pairwise(times)) < WATCHDOG
        assert "no progress" not in run.log


def test_a_wedged_line_starves_the_watchdog_and_says_where_it_stands(site: Site) -> None:
    site.line()
    site.write(poll={"interval": "50ms"})
    run = site.run(program=("-c", LINE_WEDGES), watchdog=WATCHDOG)

    run.says("the line's thread makes no progress")
    run.says("thread line: ")

    starved = len(fed(run))
    assert starved
    time.sleep(WATCHDOG)
    assert len(fed(run)) == starved
    assert "wedge" in next(line for line in run.log.splitlines() if "thread line: " in line)
    assert run.ends(signal.SIGTERM) == 0  # the loop is well


def test_a_wedged_loop_starves_the_watchdog_whose_abort_tells_where_it_stands(site: Site) -> None:
    site.line()
    site.write()
    run = site.run(program=("-c", LOOP_WEDGES), watchdog=WATCHDOG)
    run.ready()
    eventually(lambda: fed(run) and time.monotonic() - fed(run)[-1] > WATCHDOG, "nothing fed")

    assert run.ends(signal.SIGABRT) == -signal.SIGABRT

    assert "stand_still" in run.log


def test_a_line_thread_that_ends_by_a_mistake_ends_the_daemon_with_1(site: Site) -> None:
    site.write()
    run = site.run(program=("-c", LINE_ENDS))

    assert run.ends() == 1
    assert "error the line thread ended: an internal error: LookupError: no such thing" in run.log
    site.runs.clear()  # what it logs is the point
    run.manager.close()


def test_the_status_file_is_renewed_readable_by_all_and_gone_at_the_end(site: Site, view: View) -> None:
    site.line()
    site.write()
    run = site.run()
    view.wait("device/slave-1/state", good)
    eventually(run.status.exists, "status.json")

    def online() -> dict[str, Any] | None:
        status: dict[str, Any] = json.loads(run.status.read_text())
        return status if all(device["online"] for device in status["devices"]) else None

    status = eventually(online, "all online")
    assert run.status.stat().st_mode & 0o777 == 0o644
    assert set(status) >= {"v", "ts", "time", "info", "line", "devices", "broker"}
    assert status["broker"]["connected"] is True
    assert status["line"]["error"]["active"] is False
    eventually(lambda: json.loads(run.status.read_text())["ts"] > status["ts"], "the next one")
    inode = run.status.stat().st_ino
    eventually(lambda: run.status.stat().st_ino != inode, "replaced, not written over")

    run.ends(signal.SIGTERM)
    assert not list(run.status.parent.iterdir())


def test_without_systemd_the_status_file_is_in_the_session_or_nowhere(site: Site, tmp_path: Path) -> None:
    session = tmp_path / "session"
    session.mkdir()
    site.write(slaves=[])
    run = site.run(environment={"RUNTIME_DIRECTORY": "", "XDG_RUNTIME_DIR": str(session)})
    eventually((session / "lfs10d-line0/status.json").exists, "status.json in the session")
    assert run.ends(signal.SIGTERM) == 0

    nowhere = site.run(environment={"RUNTIME_DIRECTORY": ""})
    nowhere.ready()
    assert nowhere.ends(signal.SIGTERM) == 0
    assert "status.json" not in nowhere.log


def test_a_status_file_that_cannot_be_written_is_one_warning(site: Site) -> None:
    site.write(slaves=[])
    run = site.run(environment={"RUNTIME_DIRECTORY": "/proc/nowhere"})

    run.says("/proc/nowhere/status.json cannot be written")
    time.sleep(2.2)  # two more looks

    assert run.log.count("cannot be written") == 1
