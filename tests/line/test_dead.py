"""The dead cost the living little, and are found when they come back."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import pytest

from lfs10d.reading import Purpose
from tests.support.faulty_sensors import add_fault
from tests.support.lines import Rig, Rigs

ALL = range(1, 33)


LIVING = range(9, 33)


@cache
def alone() -> Rig:
    """Return the living without the dead; every test sees the same run."""
    return Rigs()(LIVING).run(90.0)


@pytest.mark.parametrize("shy", [False, True])
def test_8_of_32_dead_leave_the_others_94_percent_of_their_rate(rigs: Rigs, *, shy: bool) -> None:
    rig = rigs(ALL)
    for slave in range(1, 9):
        add_fault(rig.line.sensor(slave), "silent")
    if shy:
        for slave in LIVING:
            add_fault(rig.line.sensor(slave), "shy")
    rig.run(120.0).prove()
    rates = [len(rig.good(slave, since=60.0)) / len(alone().good(slave, since=30.0)) for slave in LIVING]
    assert sum(rates) / len(rates) >= 0.94
    # Which of the shy come right behind a probe is chance: one may lose a few polls more than another.
    assert min(rates) >= (0.93 if shy else 0.94)
    probes = [exchange for exchange in rig.exchanges if exchange.purpose is Purpose.PROBE and exchange.at > 60.0]
    assert sum(exchange.at - exchange.asked for exchange in probes) <= 0.05 * 60.0 + 1.0


def test_one_dead_slave_is_probed_after_1_2_4_8_and_then_every_15_s(rigs: Rigs) -> None:
    rig = rigs(4, interval=1.0)
    rig.run(3.5)
    add_fault(rig.line.sensor(2), "silent")
    rig.run(80.0).prove()
    probes = [reading.at for reading in rig.of(2) if reading.probe]
    waits = [later - earlier for earlier, later in pairwise(probes)]
    assert waits[:5] == pytest.approx([2.2, 4.2, 9, 15.2, 15.2], abs=0.1)


def test_after_a_power_cut_of_all_everybody_is_found_within_seconds(rigs: Rigs) -> None:
    rig = rigs(ALL, interval=1.0)
    rig.run(20.0)
    rig.line.power_cut(20.0)
    rig.run(120.0)
    assert not any(rig.of(slave)[-1].online for slave in ALL)
    rig.line.power_up()
    rig.run(126.0).prove()
    assert all(rig.good(slave, since=120.0) for slave in ALL)
    rig.run(140.0)
    assert all(len(rig.good(slave, since=130.0)) == 10 for slave in ALL)


def test_what_an_exchange_is_told_of_the_dead_does_not_grow_with_their_number(rigs: Rigs) -> None:
    rig = rigs(range(1, 250), polled=[rigs.spec(slave, 1.0) for slave in range(1, 250)])
    for slave in range(2, 250):
        add_fault(rig.line.sensor(slave), "silent")
    rig.run(700.0).prove()
    pending = rig.poller.scheduler.pending
    assert len(pending.by_slave) == 248
    assert pending.earlier(1) == ()
    assert all(len(pending.earlier(slave)) <= 8 for slave in range(2, 250))
    assert len(rig.good(1, since=690.0)) >= 9
