"""Requests of the master: read registers or bits, or write a register. ValueError for what cannot be asked at all."""

from __future__ import annotations

from typing import TypeAlias

from lfs10d.system.dataclass import dataclass

READ_COILS = 0x01
READ_DISCRETE_INPUTS = 0x02
READ_HOLDING_REGISTERS = 0x03
READ_INPUT_REGISTERS = 0x04
WRITE_SINGLE_REGISTER = 0x06
WRITE_MULTIPLE_COILS = 0x0F
WRITE_MULTIPLE_REGISTERS = 0x10
"""Function codes (Modbus Application Protocol V1.1b3, section 6); no coil is ever written."""

BIT_READS = frozenset({READ_COILS, READ_DISCRETE_INPUTS})
"""Functions that read bits: eight of them in each byte of the answer, the first one lowest."""

READS = BIT_READS | {READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS}
"""Functions that read; their answer says its length in its third byte."""

NOT_FINAL = frozenset({5, 10, 11})
"""Exceptions after which the answer may still come: acknowledged, and what a gateway says while its target is silent
(Modbus Application Protocol V1.1b3, section 7)."""

READ_COUNT_MAX = 125
"""Registers in one read (Modbus Application Protocol V1.1b3, section 6.3)."""

READ_BITS_MAX = 2000
"""Bits in one read (Modbus Application Protocol V1.1b3, sections 6.1 and 6.2)."""

BROADCAST = 0
"""The slave id that all obey and nobody answers (Modbus over Serial Line V1.02, section 2.2)."""

SLAVE_MAX = 255
"""LFS10-RS485 Protocol, slave id 0x01..0xFF: wider than the 247 of Modbus."""

_REGISTER_MAX = 0xFFFF


@dataclass(frozen=True, slots=True)
class ReadRegisters:
    """Read `count` registers from `address` (as on the wire, from 0) by function 3 or 4, or bits by function 1 or 2."""

    slave: int
    address: int
    count: int
    function: int = READ_HOLDING_REGISTERS

    def __post_init__(self) -> None:
        """Refuse what cannot be asked: such a request is a mistake of the caller."""
        if not 1 <= self.slave <= SLAVE_MAX:
            raise ValueError(f"slave {self.slave} cannot be read: ids are 1 to {SLAVE_MAX}")
        if self.function not in READS:
            raise ValueError(f"registers are read by function 3 or 4, bits by 1 or 2, not by {self.function}")
        most = READ_BITS_MAX if self.function in BIT_READS else READ_COUNT_MAX
        if not 1 <= self.count <= most:
            raise ValueError(f"{self.count} {self.what} cannot be read at once: 1 to {most}")
        if not 0 <= self.address <= _REGISTER_MAX + 1 - self.count:
            raise ValueError(f"{self.count} {self.what} from {self.address} lie outside 0..{_REGISTER_MAX}")

    @property
    def what(self) -> str:
        """What is read, in words."""
        return "bits" if self.function in BIT_READS else "registers"

    @property
    def data_bytes(self) -> int:
        """Bytes of data in the answer, as its third byte says."""
        return (self.count + 7) // 8 if self.function in BIT_READS else 2 * self.count


@dataclass(frozen=True, slots=True)
class WriteRegister:
    """Write one register by function 6 or 16; slave 0 is a broadcast, which no slave answers."""

    slave: int
    address: int
    value: int
    function: int = WRITE_SINGLE_REGISTER

    def __post_init__(self) -> None:
        """Refuse what cannot be asked: such a request is a mistake of the caller."""
        if not BROADCAST <= self.slave <= SLAVE_MAX:
            raise ValueError(f"slave {self.slave} cannot be written: ids are 0 to {SLAVE_MAX}")
        if self.function not in (WRITE_SINGLE_REGISTER, WRITE_MULTIPLE_REGISTERS):
            raise ValueError(f"a register is written by function 6 or 16, not {self.function}")
        if not (0 <= self.address <= _REGISTER_MAX and 0 <= self.value <= _REGISTER_MAX):
            raise ValueError(f"register {self.address} = {self.value} lies outside 0..{_REGISTER_MAX}")


Request: TypeAlias = ReadRegisters | WriteRegister
