"""Numbers of registers as people write them: scaled exactly in decimals, float32 at its shortest, with unit. Pure."""

from __future__ import annotations

import struct
from decimal import Decimal
from fractions import Fraction

from lfs10d.profiles.register_types import RegisterType
from lfs10d.reading import Number
from lfs10d.system.dataclass import dataclass

FLOAT32_DIGITS = 6
"""Decimal digits that every normal float32 can hold (FLT_DIG); 9 always read back (FLT_DECIMAL_DIG)."""

_MOST_FLOAT32_DIGITS = 9
SMALLEST_FLOAT = 1e-6
"""A float other than zero with a smaller magnitude is no measurement: integers read as floats look so."""

_MANTISSA = 0x007F_FFFF
_WORD = struct.Struct(">I")
_FLOAT32 = struct.Struct(">f")
_DOUBLE_WORD = struct.Struct(">Q")
_FLOAT64 = struct.Struct(">d")


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


def float_bits(number: float, kind: RegisterType) -> int:
    """Return the bits of the float32 or float64 nearest to a number."""
    pack, unpack = (_FLOAT32, _WORD) if kind == "float32" else (_FLOAT64, _DOUBLE_WORD)
    bits: int = unpack.unpack(pack.pack(number))[0]
    return bits


def float_of(bits: int, kind: RegisterType) -> float:
    """Return the number that these bits of a float32 or float64 are exactly, perhaps none."""
    pack, unpack = (_WORD, _FLOAT32) if kind == "float32" else (_DOUBLE_WORD, _FLOAT64)
    number: float = unpack.unpack(pack.pack(bits))[0]
    return number


def shortest(bits: int) -> float:
    """Return the shortest decimal that reads back as the normal or zero float32 `bits`, as a float.

    12.99 for 0x414FD70A, where `struct` alone gives 12.989999771118164. Of several equally short ones the
    nearest, of two as near the even one. Minus zero stays minus zero: its bits are what the sensor sent.
    """
    packed = _WORD.pack(bits)
    (exact,) = _FLOAT32.unpack(packed)
    number: float = exact
    for digits in range(FLOAT32_DIGITS, _MOST_FLOAT32_DIGITS):
        number = float(f"{exact:.{digits}g}")
        if _FLOAT32.pack(number) == packed:
            return number
        if not bits & _MANTISSA:
            # Below a power of two the floats lie twice as dense: the nearest decimal may fall out of
            # the narrow lower half while the next one away from zero is still within the upper half.
            number = _next_decimal(f"{exact:.{digits - 1}e}")
            if _FLOAT32.pack(number) == packed:
                return number
    return float(f"{exact:.{_MOST_FLOAT32_DIGITS}g}")


def _next_decimal(text: str) -> float:
    """Return the next decimal of as many digits, away from zero; `text` in exponent notation."""
    sign, digits, exponent = Decimal(text).as_tuple()
    mantissa = int("".join(map(str, digits))) + 1
    return float(f"{'-' if sign else ''}{mantissa}e{exponent}")


def spell(number: Number, unit: str) -> str:
    """Return a number with its unit for people: `140.2 m/s`, `100 m/s`; the unit `1` is left out."""
    text = str(int(number)) if isinstance(number, float) and number.is_integer() else repr(number)
    return text if unit == "1" else f"{text} {unit}"


def span(low: Number | None, high: Number | None, unit: str) -> str:
    """Return a range for people: `0..100 m/s`; an open end is left out; `any` where both are."""
    if low is None and high is None:
        return "any"
    first = "" if low is None else spell(low, "1")
    last = "" if high is None else spell(high, "1")
    return f"{first}..{last}" if unit == "1" else f"{first}..{last} {unit}"
