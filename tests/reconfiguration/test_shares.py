"""What the others keep of their rate while a sensor is given another place, on a line up to 70 % full. Virtual time."""

from __future__ import annotations

import pytest

from lfs10d.command import Command
from lfs10d.reconfiguration.adopt_request import AdoptRequest
from lfs10d.simulator.sensor import Sensor
from lfs10d.simulator.wire import Format
from tests.support.lives import Bench, Life

WIRE = 0.0314
"""s that one poll takes at 9600 baud with 5 ms of turnaround."""
KEPT = 0.9


def at_work(bench: Bench, sensors: int, full: float) -> tuple[Life, float]:
    """Begin a life whose sensors 2 to `sensors` + 1 fill so much of the line; return it and their interval."""
    interval = round(sensors * WIRE / full, 3)
    life = bench.sensors(*range(2, sensors + 2), poll=f"{{interval: {interval}}}")
    bench.go(life, 5.0)
    return life, interval


def kept(bench: Bench, life: Life, interval: float, *, since: float, but: str = "") -> float:
    """Return the least share of its rate that any of the others has kept since then; all its polls were good."""
    took = bench.clock.now - since
    assert took >= 10 * interval, "too short to tell"
    counts: dict[str, int] = {}
    for reading in life.readings:
        if reading.at >= since and reading.device != but:
            assert reading.fault is None
            counts[reading.device] = counts.get(reading.device, 0) + 1
    return min(counts.values()) * interval / took


@pytest.mark.parametrize("full", [0.5, 0.7])
@pytest.mark.parametrize("sensors", [3, 8, 16])
def test_during_a_readdress_the_others_keep_90_percent_of_their_rate(bench: Bench, sensors: int, full: float) -> None:
    life, interval = at_work(bench, sensors, full)
    begun = bench.clock.now
    assert bench.readdress(life, "s2", 99).status == "ok"
    assert kept(bench, life, interval, since=begun, but="s2") >= KEPT


@pytest.mark.parametrize("full", [0.5, 0.7])
@pytest.mark.parametrize("newcomer", [None, 9600, 19200])
@pytest.mark.parametrize("sensors", [3, 8, 16])
def test_during_an_adoption_the_others_keep_90_percent_of_their_rate(
    bench: Bench, sensors: int, newcomer: int | None, full: float
) -> None:
    life, interval = at_work(bench, sensors, full)
    if newcomer is not None:
        bench.line.add(Sensor(1, format=Format(newcomer)))
    begun = bench.clock.now
    answer = bench.ask(life, life.physical.adopt(AdoptRequest(), Command("n1")))
    assert answer.status == ("ok" if newcomer else "rejected")
    assert kept(bench, life, interval, since=begun) >= KEPT
