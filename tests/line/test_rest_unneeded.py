"""No healthy sensor is given more rest for what noise, a twin or a neighbour did; nor does it cost the neighbours."""

from __future__ import annotations

import pytest

from tests.support.faulty_sensors import add_fault
from tests.support.lines import Rigs

ILL = 12.0
LASTS = 20.0


@pytest.mark.parametrize("interval", [0.0, 0.25])
@pytest.mark.parametrize(
    ("kind", "rate"), [("noisy", 0.3), ("garbage", 0.7), ("leading_noise", 0.5), ("twin", 1.0), ("repeated", 0.3)]
)
def test_after_a_spell_of_noise_or_of_a_twin_no_rest_is_kept(
    rigs: Rigs, kind: str, rate: float, interval: float
) -> None:
    well = rigs(3, interval=interval, in_turn=True).run(LASTS)
    rig = rigs(3, interval=interval, in_turn=True)
    add_fault(rig.line.sensor(1), kind, rate, first=2.0, last=ILL)
    rig.run(LASTS).prove()
    assert not any(reading.gap_learned for slave in (1, 2, 3) for reading in rig.of(slave, since=ILL + 3.0))
    for slave in (2, 3):
        assert len(rig.good(slave, since=ILL + 3.0)) >= 0.9 * len(well.good(slave, since=ILL + 3.0))
