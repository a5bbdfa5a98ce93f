"""When every sensor has been offline for 30 s they are asked at the other rate, and the line's error says so."""

from __future__ import annotations

from dataclasses import replace

from lfs10d.reconfiguration.baudrate_watch import BaudrateWatch
from lfs10d.simulator.wire import Format
from tests.support.faulty_sensors import add_fault
from tests.support.lives import Bench, Life


def looking_out(bench: Bench, life: Life) -> list[str | None]:
    """Look out from now on; return what is told."""
    told: list[str | None] = []

    async def begin() -> None:
        BaudrateWatch(
            running=lambda: life.running.now,
            new_run=life.physical.new_run,
            devices=lambda: tuple(life.poller.scheduler.devices.values()),
            report=told.append,
        ).begin()

    bench.loop.run_until_complete(begin())
    return told


def test_sensors_at_the_other_rate_are_told_after_half_a_minute_and_cleared_when_they_are_back(bench: Bench) -> None:
    life = bench.sensors(3, 4)
    told = looking_out(bench, life)
    bench.go(life, 5.0)
    for sensor in bench.line.sensors:
        sensor.format = Format(19200)
    bench.go(life, 30.0)
    assert told == []
    bench.go(life, 15.0)
    assert told[-1] == (
        "no sensor answers at 9600 baud, but 2 of 2 at 19200 baud do (s3, s4); "
        "set line.baudrate to 19200; then line/baudrate can move them"
    )
    for sensor in bench.line.sensors:
        sensor.format = replace(sensor.format, baudrate=9600)
    bench.go(life, 10.0)
    assert told[-1:] == [None]
    before = len(life.readings)
    bench.go(life, 5.0)
    assert {each.device for each in life.readings[before:] if each.values} == {"s3", "s4"}


def test_nobody_is_asked_elsewhere_while_one_answers(bench: Bench) -> None:
    life = bench.sensors(3, 4)
    told = looking_out(bench, life)
    bench.line.sensor(4).format = Format(19200)
    bench.go(life, 60.0)
    assert told == []


def test_the_watch_does_not_hurry_the_line_between_its_looks(bench: Bench) -> None:
    life = bench.sensors(3, 4)
    looking_out(bench, life)
    bench.go(life, 5.5)
    assert life.poller.scheduler.patient(bench.clock.now)


def test_sensors_that_are_dead_are_found_nowhere(bench: Bench) -> None:
    life = bench.sensors(3, 4)
    told = looking_out(bench, life)
    for sensor in bench.line.sensors:
        add_fault(sensor, "silent")
    bench.go(life, 60.0)
    assert told == []
