"""The settings of a port."""

from __future__ import annotations

from typing import Any

import pytest

from lfs10d.modbus.port_settings import PortSettings, Rs485


def test_the_defaults_are_those_of_the_sensor() -> None:
    settings = PortSettings("/dev/ttyUSB0")

    assert (settings.baudrate, settings.parity, settings.databits, settings.stopbits) == (9600, "none", 8, 1)
    assert settings.low_latency
    assert settings.rs485 is None
    assert Rs485() == Rs485(rts_on_send=True, rts_after_send=False, delay_before_send=0.0, delay_after_send=0.0)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"baudrate": 9601}, "baudrate 9601 is none of 1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200"),
        ({"parity": "mark"}, "parity 'mark' is none of none, even, odd"),
        ({"databits": 6}, "databits 6 is none of 7, 8"),
        ({"stopbits": 3}, "stopbits 3 is none of 1, 2"),
    ],
)
def test_what_no_port_can_be_set_to_is_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PortSettings("/dev/ttyUSB0", **wrong)
