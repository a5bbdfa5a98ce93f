"""Registers to numbers: types, word and byte order, scale, range. Pure, and on the path of every poll.

The layouts of a 32-bit value ABCD (A the most significant byte) in two registers::

    word_order   byte_order big   byte_order little
    high_first   AB CD            BA DC
    low_first    CD AB            DC BA
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from math import inf, isnan
from typing import Literal, TypeAlias

from lfs10d.profiles.calibration import Calibration
from lfs10d.reading import Fault, FaultCode, Number

RegisterType: TypeAlias = Literal["int16", "uint16", "int32", "uint32", "float32"]
WordOrder: TypeAlias = Literal["high_first", "low_first"]
ByteOrder: TypeAlias = Literal["big", "little"]

WORDS: dict[RegisterType, int] = {"int16": 1, "uint16": 1, "int32": 2, "uint32": 2, "float32": 2}
"""Registers that one value of a type fills."""

FLOAT32_DIGITS = 6
"""Decimal digits that every normal float32 can hold (FLT_DIG); 9 always read back (FLT_DECIMAL_DIG)."""

_MOST_FLOAT32_DIGITS = 9
SMALLEST_FLOAT32 = 1e-6
"""A float32 other than zero with a smaller magnitude is no measurement: integers read as floats look so."""

_EXPONENT = 0x7F80_0000
_MANTISSA = 0x007F_FFFF
_SIGN = 0x8000_0000

_WORD = struct.Struct(">I")
_FLOAT32 = struct.Struct(">f")
_SMALLEST: int = _WORD.unpack(_FLOAT32.pack(SMALLEST_FLOAT32))[0]
"""Bits of the float32 nearest to it; magnitudes order as their bits do."""


@dataclass(frozen=True, slots=True)
class Linear:
    """`raw * scale + offset`, exact in decimals: (raw * multiplier + addend) / divisor in integers.

    5003 * 0.01 is 50.03, the float nearest to the decimal result, which float arithmetic would miss.
    """

    multiplier: int
    addend: int
    divisor: int

    @classmethod
    def of(cls, scale: Number, offset: Number) -> Linear:
        """Take `scale` and `offset` as the decimals that a person wrote (0.01 is one hundredth)."""
        factor, shift = Fraction(repr(scale)), Fraction(repr(offset))
        divisor = factor.denominator * shift.denominator
        multiplier, addend = factor * divisor, shift * divisor
        return cls(int(multiplier), int(addend), divisor)

    @property
    def plain(self) -> bool:
        """Nothing is scaled: the number stays as it is."""
        return self.multiplier == self.divisor and not self.addend

    def of_integer(self, raw: int) -> Number:
        """Scale an integer: an integer where scale and offset are integers, else the nearest float."""
        if self.divisor == 1:
            return raw * self.multiplier + self.addend
        return (raw * self.multiplier + self.addend) / self.divisor

    def of_decimal(self, number: float) -> float:
        """Scale a float as the decimal it is printed as."""
        return float((Decimal(repr(number)) * self.multiplier + self.addend) / self.divisor)


def _swap(word: int) -> int:
    return (word & 0xFF) << 8 | word >> 8


def shortest(bits: int) -> float:
    """Return the shortest decimal that reads back as the normal or zero float32 `bits`, as a float.

    12.99 for 0x414FD70A, where `struct` alone gives 12.989999771118164. Of several equally short ones the
    nearest, of two as near the even one. Minus zero stays minus zero: its bits are what the sensor sent.
    """
    (exact,) = _FLOAT32.unpack(_WORD.pack(bits))
    number: float = exact
    for digits in range(FLOAT32_DIGITS, _MOST_FLOAT32_DIGITS):
        number = float(f"{exact:.{digits}g}")
        if _float32_bits(number) == bits:
            return number
        if not bits & _MANTISSA:
            # Below a power of two the floats lie twice as dense: the nearest decimal may fall out of
            # the narrow lower half while the next one away from zero is still within the upper half.
            number = _next_decimal(f"{exact:.{digits - 1}e}")
            if _float32_bits(number) == bits:
                return number
    return float(f"{exact:.{_MOST_FLOAT32_DIGITS}g}")


def _float32_bits(number: float) -> int:
    bits: int = _WORD.unpack(_FLOAT32.pack(number))[0]
    return bits


def _next_decimal(text: str) -> float:
    """Return the next decimal of as many digits, away from zero; `text` in exponent notation."""
    sign, digits, exponent = Decimal(text).as_tuple()
    mantissa = int("".join(map(str, digits))) + 1
    return float(f"{'-' if sign else ''}{mantissa}e{exponent}")


def spell(number: Number, unit: str) -> str:
    """Return a number with its unit for people: `140.2 m/s`, `100 m/s`; the unit `1` is left out."""
    text = str(int(number)) if isinstance(number, float) and number.is_integer() else repr(number)
    return text if unit == "1" else f"{text} {unit}"


@dataclass(frozen=True, slots=True)
class Cell:
    """Where one value lies in the registers of a read, and how it becomes a number.

    `offset` counts registers from the first one read; `low` and `high` bound the published number.
    """

    name: str
    unit: str
    offset: int
    type: RegisterType
    word_order: WordOrder
    byte_order: ByteOrder
    linear: Linear
    low: Number | None
    high: Number | None
    calibration: Calibration | None = None
    """Applied to the profile's number before its range is judged."""

    def decode(self, registers: tuple[int, ...]) -> Number | Fault:
        """Return the number, or why there is none: `not_finite`, or `out_of_range` (a tiny float32 too)."""
        bits = self._bits(registers)
        kind = self.type
        number: Number
        if kind == "float32":
            if bits & _EXPONENT == _EXPONENT:
                return self._not_finite(bits)
            if bits & ~_SIGN and bits & ~_SIGN < _SMALLEST:
                return self._tiny(bits)
            number = shortest(bits)
            if not self.linear.plain:
                number = self.linear.of_decimal(number)
        elif kind == "int16":
            number = self.linear.of_integer(bits - (bits >> 15 << 16))
        elif kind == "int32":
            number = self.linear.of_integer(bits - (bits >> 31 << 32))
        else:
            number = self.linear.of_integer(bits)
        if self.calibration is not None:
            number = self.calibration.apply(number)
            if abs(number) == inf:
                return Fault(FaultCode.NOT_FINITE, f"{self.name} is infinite with its calibration")
        if (self.low is not None and number < self.low) or (self.high is not None and number > self.high):
            return self._outside(number)
        return number

    def _bits(self, registers: tuple[int, ...]) -> int:
        first = registers[self.offset]
        if self.byte_order == "little":
            first = _swap(first)
        if WORDS[self.type] == 1:
            return first
        second = registers[self.offset + 1]
        if self.byte_order == "little":
            second = _swap(second)
        return second << 16 | first if self.word_order == "low_first" else first << 16 | second

    def _not_finite(self, bits: int) -> Fault:
        (number,) = _FLOAT32.unpack(_WORD.pack(bits))
        what = "not a number (NaN)" if isnan(number) else "infinite"
        return Fault(FaultCode.NOT_FINITE, f"{self.name} is {what}: 0x{bits:08X}")

    def _tiny(self, bits: int) -> Fault:
        (number,) = _FLOAT32.unpack(_WORD.pack(bits))
        message = (
            f"{self.name} {number:.3g} (0x{bits:08X}) is smaller than any sensor measures: is the register an integer, "
            "or the word order another? Look at the device's profile"
        )
        return Fault(FaultCode.OUT_OF_RANGE, message)

    def _outside(self, number: Number) -> Fault:
        message = f"{self.name} {spell(number, self.unit)} is outside {span(self.low, self.high, self.unit)}"
        return Fault(FaultCode.OUT_OF_RANGE, message)


def span(low: Number | None, high: Number | None, unit: str) -> str:
    """Return a range for people: `0..100 m/s`; an open end is left out; `any` where both are."""
    if low is None and high is None:
        return "any"
    first = "" if low is None else spell(low, "1")
    last = "" if high is None else spell(high, "1")
    return f"{first}..{last}" if unit == "1" else f"{first}..{last} {unit}"
