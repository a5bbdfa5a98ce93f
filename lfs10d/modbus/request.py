"""Requests of the master: read registers, or write one. Raises ValueError for what cannot be asked at all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

READ_HOLDING_REGISTERS = 0x03
READ_INPUT_REGISTERS = 0x04
WRITE_SINGLE_REGISTER = 0x06
"""Function codes (Modbus Application Protocol V1.1b3, section 6)."""

NOT_FINAL = frozenset({5, 10, 11})
"""Exceptions after which the answer may still come: acknowledged, and what a gateway says while its target is silent
(Modbus Application Protocol V1.1b3, section 7)."""

READ_COUNT_MAX = 125
"""Registers in one read (Modbus Application Protocol V1.1b3, section 6.3)."""

BROADCAST = 0
"""The slave id that all obey and nobody answers (Modbus over Serial Line V1.02, section 2.2)."""

SLAVE_MAX = 255
"""LFS10-RS485 Protocol, slave id 0x01..0xFF: wider than the 247 of Modbus."""

_REGISTER_MAX = 0xFFFF


@dataclass(frozen=True, slots=True)
class ReadRegisters:
    """Read `count` registers from `address` (as on the wire, from 0) by function 3 or 4."""

    slave: int
    address: int
    count: int
    function: int = READ_HOLDING_REGISTERS

    def __post_init__(self) -> None:
        """Refuse what cannot be asked: such a request is a mistake of the caller."""
        if not 1 <= self.slave <= SLAVE_MAX:
            raise ValueError(f"slave {self.slave} cannot be read: ids are 1 to {SLAVE_MAX}")
        if self.function not in (READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS):
            raise ValueError(f"registers are read by function 3 or 4, not {self.function}")
        if not 1 <= self.count <= READ_COUNT_MAX:
            raise ValueError(f"{self.count} registers cannot be read at once: 1 to {READ_COUNT_MAX}")
        if not 0 <= self.address <= _REGISTER_MAX + 1 - self.count:
            raise ValueError(f"{self.count} registers from {self.address} lie outside 0..{_REGISTER_MAX}")


@dataclass(frozen=True, slots=True)
class WriteRegister:
    """Write one register by function 6; slave 0 is a broadcast, which nobody answers."""

    slave: int
    address: int
    value: int

    def __post_init__(self) -> None:
        """Refuse what cannot be asked: such a request is a mistake of the caller."""
        if not BROADCAST <= self.slave <= SLAVE_MAX:
            raise ValueError(f"slave {self.slave} cannot be written: ids are 0 to {SLAVE_MAX}")
        if not (0 <= self.address <= _REGISTER_MAX and 0 <= self.value <= _REGISTER_MAX):
            raise ValueError(f"register {self.address} = {self.value} lies outside 0..{_REGISTER_MAX}")

    @property
    def function(self) -> int:
        """The function code, 6."""
        return WRITE_SINGLE_REGISTER


Request: TypeAlias = ReadRegisters | WriteRegister
