"""What a simulated device measures, as the registers or bits that hold it: a second opinion on the profiles' own."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from decimal import Decimal
from typing import Final, TypeAlias

from lfs10d.profiles.register_types import RegisterType
from lfs10d.profiles.values import Value
from lfs10d.system.dataclass import dataclass

Published: TypeAlias = int | float | str | bool

READ_COILS: Final = 1
READ_DISCRETE: Final = 2
READ_HOLDING: Final = 3

_CODES: Final[Mapping[str, str]] = {
    "float32": ">f",
    "float64": ">d",
    "uint16": ">H",
    "int16": ">h",
    "uint32": ">I",
    "int32": ">i",
    "uint64": ">Q",
    "int64": ">q",
}
_FLOATS: Final = ("float32", "float64")
_WORD: Final = 2
_SIGNIFICANT: Final = 9


@dataclass(frozen=True, slots=True)
class Signal:
    """A measured value in its registers: register content x scale + offset = value.

    `bits` are the first and last bit that are meant of a content, `contents` those that stand for words, `low` and
    `high` bound what it measures: the source's number is brought between them. `nothing` is the content that means
    that there is no value.
    """

    address: int
    type: RegisterType = "float32"
    low_word_first: bool = False
    swapped: bool = False
    """The bytes within each register are swapped."""
    scale: float = 1.0
    offset: float = 0.0
    name: str = ""
    function: int = READ_HOLDING
    length: int | None = None
    bits: tuple[int, int] | None = None
    contents: tuple[tuple[int, str], ...] = ()
    low: float | None = None
    high: float | None = None
    modulo: float | None = None
    nothing: int | None = None

    @property
    def count(self) -> int:
        """How many registers it occupies, or bits."""
        if self.type == "bool":
            return 1
        code = _CODES.get(self.type)
        own: int = 1 if code is None else struct.calcsize(code) // _WORD
        return self.length or own

    @property
    def is_bit(self) -> bool:
        """Whether it is a coil or a discrete input."""
        return self.function in (READ_COILS, READ_DISCRETE)

    def fitted(self, value: float) -> float:
        """Return a source's number as one that this device can measure."""
        if self.low is None or self.high is None or self.low <= value <= self.high:
            return value
        return round(self.low + (value - self.low) % (self.high - self.low), 6)

    def words(self, value: float) -> tuple[int, ...]:
        """Return the registers that hold this value; what does not fit is bent to the nearest that does."""
        return self._ordered(self._raw(value))

    def bit(self, value: float) -> int:
        """Return the coil or discrete input that says this value."""
        return int(bool(self._content(value)))

    def settled(self, value: float) -> Published:
        """Return what its registers say of this value; of a float the decimal itself."""
        if self.contents:
            return self.contents[int(value) % len(self.contents)][1]
        if self.type == "string":
            return self._spelled(value)
        if self.type == "bool":
            return bool(int(value) % 2)
        exact = Decimal(repr(value))
        if self.type not in _FLOATS:
            exact = Decimal(self._content(value)) * Decimal(repr(self.scale)) + Decimal(repr(self.offset))
        if self.modulo is not None and not 0 <= exact < Decimal(repr(self.modulo)):
            modulo = Decimal(repr(self.modulo))
            exact = (exact % modulo + modulo) % modulo
        return value if float(exact) == value else round(float(exact), _SIGNIFICANT)

    def _raw(self, value: float) -> bytes:
        if self.type in _FLOATS:
            return struct.pack(_CODES[self.type], self._unscaled(value))
        if self.type == "string":
            return self._spelled(value).encode().ljust(_WORD * self.count, b"\0")
        content = self._content(value)
        if self.type == "bcd":
            return bytes.fromhex(f"{content:0{4 * self.count}d}")
        if self.bits is not None:
            first, last = self.bits
            content = (content & (1 << last - first + 1) - 1) << first
        return (content % (1 << 16 * self.count)).to_bytes(_WORD * self.count, "big")

    def _unscaled(self, value: float) -> float:
        if self.scale == 1 and self.offset == 0:
            return value
        return float((Decimal(repr(value)) - Decimal(repr(self.offset))) / Decimal(repr(self.scale)))

    def _spelled(self, value: float) -> str:
        return f"V{value:.4f}"[: _WORD * self.count]

    def _content(self, value: float) -> int:
        """Return the whole number in the registers, a part of them where only bits are meant."""
        if self.contents:
            return self.contents[int(value) % len(self.contents)][0]
        if self.type == "bool":
            return int(value) % 2
        wanted = round((value - self.offset) / self.scale)
        if self.type == "bcd":
            most: int = 10 ** (4 * self.count) - 1
            return min(max(wanted, 0), most)
        width = 8 * _WORD * self.count if self.bits is None else self.bits[1] - self.bits[0] + 1
        low = 0 if self.type.startswith("u") else -(1 << width - 1)
        content: int = min(max(wanted, low), low + (1 << width) - 1)
        return content

    def broken(self, float_bits: int) -> tuple[int, ...]:
        """Return these bits of a float32, or all ones in a register that holds whole numbers."""
        if self.type == "float32":
            return self._ordered(float_bits.to_bytes(2 * _WORD, "big"))
        if self.type == "float64":
            (number,) = struct.unpack(">f", float_bits.to_bytes(2 * _WORD, "big"))
            return self._ordered(struct.pack(">d", number))
        return (0xFFFF,) * self.count

    def empty(self) -> tuple[int, ...]:
        """Return the registers that say that there is no value."""
        if self.nothing is None:
            return (0xFFFF,) * self.count
        content = self.nothing
        if self.bits is not None and self._part_holds(content):
            content <<= self.bits[0]
        return self._ordered(content.to_bytes(_WORD * self.count, "big"))

    @property
    def empty_masks(self) -> tuple[int, ...]:
        """The bits of each register that say that there is no value: all, where a part cannot say so."""
        whole = self.nothing is not None and not self._part_holds(self.nothing)
        return (0xFFFF,) * self.count if whole else self.masks

    def _part_holds(self, content: int) -> bool:
        return self.bits is None or content < 1 << self.bits[1] - self.bits[0] + 1

    @property
    def masks(self) -> tuple[int, ...]:
        """The bits of each register that are its own."""
        if self.bits is None:
            return (0xFFFF,) * self.count
        first, last = self.bits
        mask = (1 << last - first + 1) - 1 << first
        return self._ordered(mask.to_bytes(_WORD * self.count, "big"))

    def _ordered(self, data: bytes) -> tuple[int, ...]:
        words = struct.unpack(f"{'<' if self.swapped else '>'}{len(data) // _WORD}H", data)
        return words[::-1] if self.low_word_first else words


def signal_of(value: Value) -> Signal:
    """Return what a device measures that a profile describes."""
    low, high = value.range or (None, None)
    bits = value.bits
    if value.byte is not None:
        bits = (8, 15) if value.byte == "high" else (0, 7)
    elif value.mask is not None:
        places = [place for place in range(64) if value.mask >> place & 1]
        bits = (places[0], places[-1])
    return Signal(
        value.register,
        value.type,
        low_word_first=value.word_order == "low_first",
        swapped=value.byte_order == "little",
        scale=value.scale,
        offset=value.offset,
        name=value.name,
        function=value.function,
        length=value.length,
        bits=bits,
        contents=tuple((value.map or {}).items()),
        low=low,
        high=high,
        modulo=value.modulo,
        nothing=_nothing(value),
    )


def _nothing(value: Value) -> int | None:
    """Return the first content that means that there is no value, as bits."""
    if not value.unavailable:
        return None
    first = value.unavailable[0]
    if not isinstance(first, int):
        return int.from_bytes(struct.pack(_CODES[value.type], first), "big")
    content: int = first % (1 << 16 * value.words)
    return content
