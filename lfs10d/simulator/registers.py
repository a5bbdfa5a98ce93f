"""What a simulated device is: registers, signals, limits. LFS10 here; every other device is just data too."""

from __future__ import annotations

import struct
from collections.abc import Container, Mapping
from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias

from lfs10d.profiles.profile import Profile
from lfs10d.profiles.values import Setting
from lfs10d.simulator.wire import Check, Framing

Type: TypeAlias = Literal["float32", "uint16", "int16", "uint32", "int32"]

READ_HOLDING: Final = 3
READ_INPUT: Final = 4
WRITE_SINGLE: Final = 6

_CODES: Final[Mapping[Type, str]] = {
    "float32": ">f",
    "uint16": ">H",
    "int16": ">h",
    "uint32": ">I",
    "int32": ">i",
}
_WORD: Final = 2


@dataclass(frozen=True, slots=True)
class Signal:
    """A measured value in one or two registers: register content x scale + offset = value."""

    address: int
    type: Type = "float32"
    low_word_first: bool = False
    swapped: bool = False
    """The bytes within each register are swapped."""
    scale: float = 1.0
    offset: float = 0.0

    @property
    def count(self) -> int:
        """How many registers it occupies."""
        return struct.calcsize(_CODES[self.type]) // _WORD

    def words(self, value: float) -> tuple[int, ...]:
        """Return the registers that hold this value; what does not fit is bent to the nearest that does."""
        if self.type == "float32":
            return self._ordered(struct.pack(">f", (value - self.offset) / self.scale))
        return self._ordered(struct.pack(_CODES[self.type], self._content(value)))

    def settled(self, value: float) -> float:
        """Return the value as its registers tell it; of a float32 the decimal itself."""
        return value if self.type == "float32" else round(self._content(value) * self.scale + self.offset, 9)

    def _content(self, value: float) -> int:
        bits = 8 * _WORD * self.count
        low = 0 if self.type.startswith("u") else -(1 << bits - 1)
        return min(max(round((value - self.offset) / self.scale), low), low + (1 << bits) - 1)

    def broken(self, float_bits: int) -> tuple[int, ...]:
        """Return these bits of a float32, or all ones in a register that holds whole numbers."""
        if self.type == "float32":
            return self._ordered(float_bits.to_bytes(2 * _WORD, "big"))
        return (0xFFFF,) * self.count

    def _ordered(self, data: bytes) -> tuple[int, ...]:
        words = struct.unpack(f"{'<' if self.swapped else '>'}{len(data) // _WORD}H", data)
        return words[::-1] if self.low_word_first else words


@dataclass(frozen=True, slots=True)
class Blueprint:
    """One kind of device. Registers that are neither in `words` nor of a signal do not exist."""

    name: str
    signals: tuple[Signal, ...]
    words: Mapping[int, int] = field(default_factory=dict)
    """Other registers and what they hold at first."""
    writable: Mapping[int, Container[int]] = field(default_factory=dict)
    """What may be written where; another value is exception 03, another register exception 02."""
    functions: frozenset[int] = frozenset({READ_HOLDING, WRITE_SINGLE})
    max_words: int = 125
    ascii_max_data: int | None = None
    """Data bytes of the longest ASCII answer, the byte count among them (Fuling DZB manual, appendix B)."""
    check: Check = "crc"
    id_register: int | None = None
    rate_register: int | None = None
    rate_codes: Mapping[int, int] = field(default_factory=dict)
    """Content of the rate register by baud rate."""

    def most_words(self, framing: Framing) -> int:
        """Return how many registers one read may ask for."""
        if framing == "rtu" or self.ascii_max_data is None:
            return self.max_words
        return min(self.max_words, (self.ascii_max_data - 1) // _WORD)


LFS10: Final = Blueprint(
    name="lfs10",
    signals=(Signal(0x0001),),
    words={0x0004: 1, 0x0005: 1},
    writable={0x0004: range(1, 3), 0x0005: range(1, 256)},
    id_register=0x0005,
    rate_register=0x0004,
    rate_codes={9600: 1, 19200: 2},
)
"""Wind speed at 0x0001-2, rate code at 0x0004, slave id at 0x0005 (LFS10 manual, register table)."""


@dataclass(frozen=True, slots=True)
class Allowed:
    """What a setting of a profile may be written."""

    setting: Setting

    def __contains__(self, word: object) -> bool:
        """Say whether the profile takes this register content."""
        return isinstance(word, int) and self.setting.refusal(word) is None


def blueprint_of(profile: Profile) -> Blueprint:
    """Return the device that a profile describes; registers it does not name do not exist."""
    signals = tuple(
        Signal(
            value.register,
            value.type,
            low_word_first=value.word_order == "low_first",
            swapped=value.byte_order == "little",
            scale=value.scale,
            offset=value.offset,
        )
        for value in profile.values
    )
    functions = {value.function for value in profile.values}
    words: dict[int, int] = {}
    writable: dict[int, Container[int]] = {}
    for setting in profile.settings:
        allowed = Allowed(setting)
        words[setting.register] = (
            next((word for word in range(1 << 16) if word in allowed), 0) if setting.writable else 0
        )
        if setting.writable:
            writable[setting.register] = allowed
    if profile.slave_id is not None:
        words[profile.slave_id.register] = profile.ids[0]
        writable[profile.slave_id.register] = range(profile.ids[0], profile.ids[1] + 1)
    if profile.baudrate is not None:
        codes = profile.baudrate.codes
        words[profile.baudrate.register] = next(iter(codes.values()))
        writable[profile.baudrate.register] = frozenset(codes.values())
    if profile.barrier is not None:
        functions.add(profile.barrier.function)
        for register in range(profile.barrier.register, profile.barrier.register + profile.barrier.count):
            words.setdefault(register, 0)
    if words:
        functions.add(READ_HOLDING)
    return Blueprint(
        name=profile.name,
        signals=signals,
        words=words,
        writable=writable,
        functions=frozenset(functions | ({WRITE_SINGLE} if writable else set())),
        max_words=profile.max_words,
        ascii_max_data=profile.ascii_max_data,
        check=profile.checksum,
        id_register=profile.slave_id.register if profile.slave_id else None,
        rate_register=profile.baudrate.register if profile.baudrate else None,
        rate_codes=profile.baudrate.codes if profile.baudrate else {},
    )
