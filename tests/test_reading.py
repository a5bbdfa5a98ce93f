"""What the line thread tells uses the contract's words, and what it says of device and port do not overlap."""

from __future__ import annotations

from pathlib import Path

from lfs10d.reading import ALIVE_CODES, PORT_CODES, FaultCode

CODES = (
    "timeout crc malformed wrong_slave wrong_function exception out_of_range not_finite unavailable late collision "
    "starting disabled overrun port_lost port_busy wrong_rate duplicate_id config_conflict storage_full "
    "duplicate_client"
)


def test_the_codes_are_those_that_the_reference_lists() -> None:
    assert [code.value for code in FaultCode] == CODES.split()
    reference = (Path(__file__).parent.parent / "docs" / "mqtt.md").read_text()
    assert [code for code in CODES.split() if f"`{code}`" not in reference] == []


def test_no_fault_is_the_ports_and_proves_the_device_alive() -> None:
    assert not ALIVE_CODES & PORT_CODES
