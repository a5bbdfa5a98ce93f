"""The backlog on disk, from outside: broker away, daemon killed, disk full, file damaged."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest

from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.wire import nanoseconds
from tests.support.brokers import Mosquitto
from tests.support.sites import ENDS_WITHIN, QUICK, Site, View, eventually, good

COMMITTED_WITHIN = 8.0
"""Seconds after which a sample is on the disk while the broker is away: 3 s of youth, 5 s between two commits."""


def backlog_of(site: Site) -> Path:
    return site.folder / "state" / "backlog.db"


def committed(site: Site) -> dict[str, int]:
    """Return how many samples of each device a copy of the daemon's file holds; none where it is just being made."""
    copy = site.folder / "copy.db"
    for end in ("", "-wal"):
        beside = backlog_of(site).with_name(f"backlog.db{end}")
        if beside.exists():
            copy.with_name(f"copy.db{end}").write_bytes(beside.read_bytes())
    with closing(sqlite3.connect(copy)) as db:
        if not db.execute("SELECT count(*) FROM sqlite_schema WHERE name = 'sample'").fetchone()[0]:
            return Counter()
        rows = db.execute("SELECT facts FROM sample JOIN series ON series.id = series").fetchall()
    return Counter(json.loads(facts)[1] for (facts,) in rows)


def past(view: View, device: str) -> list[tuple[str, int]]:
    """Return (boot, seq) of what came on `history`, in order of arrival."""
    return [(one["boot"], one["seq"]) for array in view.history_of(f"device/{device}/history") for one in array]


def numbers(view: View, device: str, boot: str) -> list[int]:
    """Return every seq heard of one boot, in order, each once."""
    return sorted({one["seq"] for one in view.samples(device) if one["boot"] == boot})


def answered_by(line: SimulatedLine, slave: int, before: int | None = None) -> int:
    """Return how many requests for its value a slave has answered, of those `before` a time of the line (ns)."""
    heard = [request for request in list(line.log) if before is None or request.ended < before]
    answers = [answer for request in heard for answer in request.answers]
    return sum(bool(answer.values) and answer.sensor.slave == slave for answer in answers)


def test_lives_killed_and_ended_while_the_broker_is_away_are_delivered_in_order_by_the_next(
    site: Site, mosquitto: Mosquitto
) -> None:
    """Kill -9 loses nothing that was committed and 8 s at most, SIGTERM nothing; and nothing comes twice."""
    mosquitto.stop()
    terminal = site.line()
    line = terminal.line
    site.pace = QUICK
    # Before other programs, where that is permitted: an answer that is read late is in doubt, and is asked for again.
    # At an interval of 50 ms the line has no room for that.
    site.write(line={"realtime": True}, poll={"interval": "100ms"})
    first = site.run()
    first.ready()

    def after_a_while(claim: Callable[[], bool]) -> bool:
        """Look rarely: while this thread looks, that of the line has to wait, and answers late."""
        time.sleep(0.2)
        return claim()

    eventually(
        partial(after_a_while, lambda: backlog_of(site).exists() and committed(site)["slave-1"] > 40), "two commits"
    )
    old = nanoseconds(terminal.now() - COMMITTED_WITHIN)
    first.ends(signal.SIGKILL)
    killed = committed(site)["slave-1"]
    assert killed >= answered_by(line, 1, before=old)

    asked = answered_by(line, 1)
    second = site.run()
    second.ready()
    # Less than it takes to be old: it waits in memory alone.
    eventually(partial(after_a_while, lambda: answered_by(line, 1) >= asked + 25), "25 more answers")
    began = time.monotonic()
    assert second.ends(signal.SIGTERM) == 0
    assert time.monotonic() - began < ENDS_WITHIN
    ended = committed(site)["slave-1"] - killed
    measured = answered_by(line, 1) - asked
    assert ended >= 20
    assert ended >= 0.9 * measured, "an answer in doubt, or a late one, is asked for again"

    third = site.run()
    third.ready()
    time.sleep(4)  # until it has a past of its own
    mosquitto.start()
    view = View(mosquitto.subscribe())
    boot = view.wait("info")["boot"]
    figures = view.wait("line/stats")["store"]
    assert figures["depth"] >= 2 * (killed + ended)
    assert figures["oldest_ts"] < view.newest("info")["started"]
    eventually(lambda: len(past(view, "slave-1")) > killed + ended, "the past of all three", within=30)

    told = past(view, "slave-1")
    boots = sorted({one for one, _ in told})
    assert boots[2:] == [boot]
    assert told == sorted(told)
    assert told[:killed] == [(boots[0], seq) for seq in range(1, killed + 1)]
    assert told[killed : killed + ended] == [(boots[1], seq) for seq in range(1, ended + 1)]
    assert len(told) == len(set(told))
    assert numbers(view, "slave-1", boot)[0] == 1
    assert third.ends(signal.SIGTERM) == 0


@pytest.mark.long(35)
def test_four_kills_of_the_broker_at_full_rate_lose_nothing(site: Site, mosquitto: Mosquitto) -> None:
    """It keeps nothing itself, and what it acknowledged last may never have reached anybody."""
    site.line()
    site.pace = QUICK
    site.write(poll={"interval": 0})
    run = site.run()
    view = View(mosquitto.subscribe())
    live = f"{view.base}/device/slave-1/telemetry"
    view.listener.wait_for(live)
    log = backlog_of(site).with_name("backlog.db-wal")
    before = (backlog_of(site).stat(), log.stat())
    view.listener.wait_for(live, 300, within=30)
    assert (backlog_of(site).stat(), log.stat()) == before  # nothing is written while the broker is there
    for down in (0.0, 4.0, 1.0, 3.5):
        mosquitto.kill()
        time.sleep(down)
        heard = len(view.listener.on(live))
        mosquitto.start()
        view.listener.wait_for(live, heard + 50, within=30)
    newest = json.loads(view.listener.on(live)[-1].payload)["seq"]
    boot = view.newest("info")["boot"]

    def whole() -> bool:
        time.sleep(0.5)
        return all(
            (found := numbers(view, device, boot)) == list(range(1, len(found) + 1)) and found[-1] > newest
            for device in ("slave-1", "slave-2")
        )

    eventually(whole, "every sample", within=30)
    assert not [each for each in view.history_of("event") if each["type"] == "dropped"]
    assert run.ends(signal.SIGTERM) == 0


def test_damage_is_put_aside_and_reported_and_no_reason_not_to_start(site: Site, view: View) -> None:
    site.line()
    site.write()
    backlog_of(site).parent.mkdir()
    backlog_of(site).write_bytes(b"SQLite format 3\0" + bytes(9000))
    run = site.run()
    view.wait("device/slave-1/state", good)
    told = eventually(
        lambda: [each for each in view.history_of("event") if each["type"] == "store_put_aside"], "the event"
    )
    boot = view.wait("info")["boot"]
    assert told[0]["file"] == f"backlog.db.corrupt-{boot}"
    assert (site.folder / "state" / told[0]["file"]).stat().st_size == 9016
    run.says("it is put aside as")
    assert not view.newest("line/error")["active"]


@pytest.fixture
def full_disk(site: Site) -> Iterator[Path]:
    """Give a state directory on a disk that is full; where mounting is not permitted, one that is no directory."""
    place = site.folder / "state"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=128k", "tmpfs", str(place)]
    mounted = os.geteuid() == 0 and subprocess.run(mount, check=False, capture_output=True).returncode == 0
    ballast = place / "ballast"
    if mounted:
        with ballast.open("wb", buffering=0) as file:
            file.truncate(0)
            while file.write(bytes(4096)) == 4096 and file.tell() < 100 * 1024:
                pass
    else:
        place.rmdir()
        place.touch()
    yield ballast if mounted else place
    if mounted:
        for run in site.runs:
            run.process.kill()
            run.process.wait()
        subprocess.run(["umount", "-l", str(place)], check=True)


def test_with_a_full_disk_it_measures_on_from_memory_and_says_so_until_there_is_room(
    site: Site, mosquitto: Mosquitto, full_disk: Path
) -> None:
    site.line()
    site.pace = QUICK
    site.write(poll={"interval": "20ms"})
    run = site.run()
    view = View(mosquitto.subscribe())
    view.wait("device/slave-1/state", good)
    mosquitto.stop()
    run.says("backlog.db: ")
    time.sleep(3)
    mosquitto.start()
    error = view.wait("line/error", lambda each: each["active"])
    assert error["code"] == "storage_full"
    full_disk.unlink()
    view.wait("line/error", lambda each: not each["active"])
    boot = view.newest("info")["boot"]
    newest = max(one["seq"] for one in view.samples("slave-1"))

    def whole() -> bool:
        found = numbers(view, "slave-1", boot)
        return found == list(range(1, len(found) + 1)) and found[-1] > newest

    eventually(whole, "every sample", within=30)
    assert run.process.poll() is None
