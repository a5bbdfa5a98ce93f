"""Who is silent or bad at the start is known in seconds, whoever else answers."""

from __future__ import annotations

import pytest

from lfs10d.reading import Purpose
from tests.support.faulty_sensors import add_fault
from tests.support.lines import Rigs

BAD = (2, 4, 6, 8)
GOOD = (1, 3, 5, 7)


@pytest.mark.parametrize("fault", ["silent", "noisy", "garbage", "truncated", "wrong_id", "wrong_function"])
def test_four_bad_among_eight_have_failed_three_times_within_eight_seconds(rigs: Rigs, fault: str) -> None:
    rig = rigs(8, interval=1.0)
    for slave in BAD:
        add_fault(rig.line.sensor(slave), fault)
    rig.run(30.0).prove()
    for slave in BAD:
        assert rig.of(slave)[2].at < 8.0
        assert not any(reading.online for reading in rig.of(slave))
    assert all(len(rig.good(slave, since=10.0)) == pytest.approx(20, abs=1) for slave in GOOD)


@pytest.mark.parametrize("fault", ["noisy", "garbage", "truncated", "wrong_function"])
def test_one_that_answers_badly_is_polled_as_one_that_answers(rigs: Rigs, fault: str) -> None:
    rig = rigs(8, interval=1.0)
    for slave in BAD:
        add_fault(rig.line.sensor(slave), fault)
    rig.run(60.0).prove()
    for slave in range(1, 9):
        assert len(rig.of(slave, since=10.0)) == pytest.approx(50, abs=1)
    assert not any(exchange.purpose is Purpose.PROBE for exchange in rig.exchanges)


def test_of_32_with_half_of_them_silent_each_silent_one_has_failed_within_ten_seconds(rigs: Rigs) -> None:
    rig = rigs(32, interval=1.0)
    for slave in range(17, 33):
        add_fault(rig.line.sensor(slave), "silent")
    rig.run(20.0).prove()
    assert all(rig.of(slave)[0].at < 10.0 for slave in range(1, 33))
    assert all(len(rig.of(slave)) >= 3 for slave in range(1, 33))


def test_when_the_port_is_back_the_silent_are_polled_three_times_at_once_again(rigs: Rigs) -> None:
    rig = rigs(4, interval=1.0)
    add_fault(rig.line.sensor(2), "silent")
    rig.run(60.0)
    rig.port.unplug()
    rig.run(62.0)
    rig.port.replug()
    rig.run(66.0).prove()
    back = rig.port_changes[-1].at
    again = [reading for reading in rig.of(2, since=back) if not reading.probe]
    assert len(again) == 3
    assert again[-1].at < back + 2.5
