"""A scan on request: what is told while it runs, and how it ends. The line is simulated, in virtual time."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from lfs10d.commands import scanner
from lfs10d.commands.scanner import Scanner
from lfs10d.config.loader import load
from lfs10d.line.jobs.job import Job
from lfs10d.line.jobs.scan import Scan
from lfs10d.line.poller import Poller
from lfs10d.line.scheduler import Scheduler
from lfs10d.line.settings import scan_plan
from lfs10d.modbus.bus import Bus, LineRules
from lfs10d.modbus.port_settings import PortSettings
from lfs10d.reading import Event
from lfs10d.simulator.line import SimulatedLine
from lfs10d.simulator.sensor import Sensor
from tests.support.virtual_port import SimulatedPort, VirtualClock, run

IDS = tuple(range(1, 41))


class Bench:
    """A line with sensors that nobody polls; `told` is every event, `acts` what the line was said to be busy with."""

    def __init__(self, folder: Path, *slaves: int) -> None:
        self.told: list[dict[str, Any]] = []
        self.acts: list[str | None] = []
        self.clock = VirtualClock()
        self.port = SimulatedPort(
            SimulatedLine([Sensor(slave, turnaround=0.002 * (number + 1)) for number, slave in enumerate(slaves)]),
            self.clock,
            PortSettings("/dev/simulated"),
        )
        bus = Bus(self.port, LineRules(), self.clock)
        events: list[Event] = []
        self.poller = Poller(bus, Scheduler(bus.line_timing, 0.0), events.extend, self.clock)
        fake: Any = self
        self.scanning = Scanner(fake, fake)
        file = folder / "lfs10d.yaml"
        file.write_text("line: {port: tty}\nslaves: []\nmqtt: {host: localhost}\n")
        self.search = scan_plan(load(file), IDS, (9600,), share=0.9)

    def submit(self, job: Job) -> None:
        self.poller.submit(job)

    def act(self, activity: str | None) -> None:
        self.acts.append(activity)

    def announce(self, kind: str, facts: Mapping[str, object]) -> None:
        self.told.append({"type": kind, **facts})

    def of(self, kind: str) -> list[dict[str, Any]]:
        return [each for each in self.told if each["type"] == kind]

    def begin(self) -> asyncio.Task[Scan]:
        return asyncio.get_running_loop().create_task(self.scanning.scan(self.search))

    async def go_on(self, seconds: float) -> None:
        """Let the line go on, half a second at a time, and whoever follows the scan look at it."""
        until = self.clock.now + seconds
        while self.clock.now < until:
            run(self.poller.turn, self.port, self.clock, min(until, self.clock.now + 0.5))
            for _ in range(3):
                await asyncio.sleep(0.001)


@pytest.fixture(autouse=True)
def looks_often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scanner, "LOOK_EVERY", 0.0005)


def test_it_tells_how_far_it_is_a_few_times_and_that_it_is_over(tmp_path: Path) -> None:
    async def scene() -> None:
        bench = Bench(tmp_path, 1, 2, 30)
        task = bench.begin()
        await bench.go_on(30.0)
        scan = await task
        assert (scan.complete, scan.lost) == (True, False)
        assert [finding.slave for finding in scan.found] == [1, 2, 30]
        told = bench.of("scan_progress")
        percents = [each["percent"] for each in told]
        assert (percents[0], percents[-1]) == (0.0, 100.0)
        assert 4 <= len(percents) <= 12
        assert percents == sorted(set(percents))
        assert told[-1] == {
            "type": "scan_progress", "percent": 100.0, "remaining_s": 0.0, "asked": 40, "total": 40,
            "slave": 40, "baudrate": 9600, "found": 3,
        }  # fmt: skip
        assert bench.acts == ["scanning", None]
        assert not bench.scanning.cancel()

    asyncio.run(scene())


def test_a_cancelled_scan_is_over_at_once_and_asks_nobody_any_more(tmp_path: Path) -> None:
    async def scene() -> None:
        bench = Bench(tmp_path, 1, 2, 30)
        task = bench.begin()
        await bench.go_on(1.0)
        assert bench.scanning.cancel()
        scan = await task
        assert (scan.complete, scan.lost) == (False, False)
        assert [finding.slave for finding in scan.found] == [1, 2]
        await bench.go_on(5.0)
        assert scan.over
        assert scan.progress.asked < 20
        assert bench.of("scan_progress")[-1]["percent"] < 100
        assert bench.acts == ["scanning", None]

    asyncio.run(scene())


def test_when_the_daemon_ends_what_was_found_is_told(tmp_path: Path) -> None:
    async def scene() -> None:
        bench = Bench(tmp_path, 1)
        task = bench.begin()
        await bench.go_on(1.0)
        task.cancel()
        scan = await task
        assert (scan.complete, len(scan.found)) == (False, 1)

    asyncio.run(scene())


def test_a_lost_port_ends_it(tmp_path: Path) -> None:
    async def scene() -> None:
        bench = Bench(tmp_path, 1)
        task = bench.begin()
        await bench.go_on(1.0)
        bench.port.unplug()
        await bench.go_on(1.0)
        scan = await task
        assert (scan.complete, scan.lost, len(scan.found)) == (False, True, 1)

    asyncio.run(scene())


def test_two_sensors_with_one_id_are_told_once(tmp_path: Path) -> None:
    async def scene() -> None:
        bench = Bench(tmp_path, 7, 7)
        task = bench.begin()
        await bench.go_on(30.0)
        assert (await task).complete
        assert bench.of("duplicate_id") == [{"type": "duplicate_id", "slave": 7, "baudrate": 9600}]

    asyncio.run(scene())
