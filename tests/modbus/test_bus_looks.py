"""The last look before a request is a fresh one."""

from __future__ import annotations

import pytest

from tests.modbus.test_bus import READ, REQUEST, T9600, Rig


def test_a_look_that_is_old_is_taken_again_before_it_speaks() -> None:
    """Another program had the processor between the look and the request, and bytes came meanwhile."""
    rig = Rig().opened()
    look = rig.port.waiting
    looks: list[int] = []

    def slowly() -> int:
        looks.append(look())
        if len(looks) == 1:
            rig.clock.now += 0.005
            rig.port.incoming += b"xyz"
        return looks[-1]

    rig.port.waiting = slowly  # type: ignore[method-assign]  # only this time
    rig.bus.ask(READ, {})
    assert rig.waits(T9600.gap) == pytest.approx(T9600.gap)
    assert looks == [0, 3]
    assert rig.port.written == []
    rig.waits(T9600.gap)
    assert rig.port.written == [REQUEST]
