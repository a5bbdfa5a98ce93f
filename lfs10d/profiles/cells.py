"""Turns registers into values, for every poll: a cell knows where one value lies in a read. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from math import inf, isfinite, isnan
from typing import NamedTuple

from lfs10d.profiles.calibration import Calibration
from lfs10d.profiles.decimals import SMALLEST_FLOAT, Linear, float_bits, float_of, shortest, span, spell
from lfs10d.profiles.register_types import ByteOrder, RegisterType, WordOrder
from lfs10d.reading import Fault, FaultCode, Number, Value
from lfs10d.system.dataclass import dataclass

_EXPONENT = 0x7F80_0000
_SIGN = 0x8000_0000
_SMALLEST = float_bits(SMALLEST_FLOAT, "float32")
"""Bits of the float32 nearest to it; magnitudes order as their bits do."""


class Part(NamedTuple):
    """The bits of a content that are the value: `width` bits from bit `shift` on (0 is the lowest)."""

    shift: int
    width: int

    def of(self, content: int) -> int:
        """Return the part of a content."""
        return content >> self.shift & (1 << self.width) - 1


def _swap(word: int) -> int:
    return (word & 0xFF) << 8 | word >> 8


@dataclass(frozen=True, slots=True)
class Cell:
    """Where one value lies in the registers (or bits) of a read, and how it is decoded.

    `offset` counts registers from the first one read; `low` and `high` bound the published number. `part` are the bits
    that are meant, None for all. From `signed_from` on a content is negative (0: never). `texts` are the words for the
    contents. Contents in `unavailable` mean that there is no value; one that is no content of the part is looked for
    in the whole. `modulo`: numbers wrap around there.
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
    words: int = 1
    part: Part | None = None
    signed_from: int = 0
    texts: Mapping[int, str] | None = None
    unavailable: frozenset[int] = frozenset()
    modulo: float | None = None
    calibration: Calibration | None = None
    """Applied to the profile's number before `modulo` and `range`."""
    shows_raw: bool = False
    """Return the number without calibration, if the calibrated one is in range."""

    def decode(self, registers: tuple[int, ...]) -> Value | Fault:
        """Return the value, or the fault: `unavailable`, `not_finite` or `out_of_range` (also for a tiny float)."""
        content = self._content(registers)
        bits = content if self.part is None else self.part.of(content)
        if self.unavailable and self._is_unavailable(content, bits):
            return self._nothing(content)
        value = self._float32(bits) if self.type == "float32" else self._of_another_kind(bits)
        return value if isinstance(value, (Fault, str)) else self.believed(value)

    def believed(self, number: Number) -> Number | Fault:
        """Return the calibrated number as it is published, or the fault."""
        raw = number
        if self.calibration is not None:
            number = self.calibration.apply(number)
            if abs(number) == inf:
                return Fault(FaultCode.NOT_FINITE, f"{self.name} is infinite with its calibration")
        if self.modulo is not None and not 0 <= number < self.modulo:
            number = self._wrapped(number)
        if (self.low is not None and number < self.low) or (self.high is not None and number > self.high):
            return self._outside(number)
        return raw if self.shows_raw else number

    def _content(self, registers: tuple[int, ...]) -> int:
        first = registers[self.offset]
        if self.byte_order == "little":
            first = _swap(first)
        if self.words == 1:
            return first
        words = registers[self.offset : self.offset + self.words]
        if self.byte_order == "little":
            words = tuple(map(_swap, words))
        content = 0
        for word in words if self.word_order == "high_first" else reversed(words):
            content = content << 16 | word
        return content

    def _is_unavailable(self, content: int, bits: int) -> bool:
        if bits in self.unavailable:
            return True
        return self.part is not None and content in self.unavailable and content >= 1 << self.part.width

    def _float32(self, bits: int) -> Number | Fault:
        if bits & _EXPONENT == _EXPONENT:
            return self._not_finite(bits)
        if bits & ~_SIGN and bits & ~_SIGN < _SMALLEST:
            return self._tiny(bits)
        number = shortest(bits)
        return number if self.linear.plain else self.linear.of_decimal(number)

    def _of_another_kind(self, bits: int) -> Value | Fault:
        """Return a whole number, a float64, digits, text, a boolean or a word."""
        match self.type:
            case "string":
                return self._text(bits)
            case "bcd":
                return self._digits(bits)
            case "float64":
                return self._float64(bits)
        number = bits - 2 * self.signed_from if self.signed_from and bits >= self.signed_from else bits
        if self.texts is not None:
            return self.texts.get(number) or self._unknown(number)
        return bool(number) if self.type == "bool" else self.linear.of_integer(number)

    def _float64(self, bits: int) -> Number | Fault:
        number = float_of(bits, "float64")
        if not isfinite(number):
            return self._not_finite(bits)
        if number and abs(number) < SMALLEST_FLOAT:
            return self._tiny(bits)
        if not self.linear.plain:
            number = self.linear.of_decimal(number)
        return number if isfinite(number) else self._not_finite(bits)

    def _text(self, bits: int) -> Value | Fault:
        raw, _, _ = bits.to_bytes(2 * self.words, "big").partition(b"\0")
        text = raw.decode("ascii", "replace").strip()
        if text.isascii() and text.isprintable():
            return text
        return Fault(FaultCode.OUT_OF_RANGE, f"{self.name} is no text: {raw.hex(' ').upper()}")

    def _digits(self, bits: int) -> Number | Fault:
        digits = f"{bits:0{4 * self.words}X}"
        if not digits.isdecimal():
            return Fault(FaultCode.OUT_OF_RANGE, f"{self.name} holds 0x{digits}, which is no decimal number (bcd)")
        return self.linear.of_integer(int(digits))

    def _wrapped(self, number: Number) -> Number:
        modulo = Fraction(repr(self.modulo))
        wrapped = Fraction(repr(number)) % modulo
        return int(wrapped) if isinstance(number, int) and wrapped.denominator == 1 else float(wrapped)

    def _nothing(self, content: int) -> Fault:
        held = f"0x{content:0{4 * self.words}X}"
        return Fault(FaultCode.UNAVAILABLE, f"{self.name} is not available: the device sent {held}")

    def _unknown(self, content: int) -> Fault:
        known = ", ".join(map(str, self.texts or ()))
        return Fault(
            FaultCode.OUT_OF_RANGE,
            f"{self.name} holds {content}, which the profile's map does not name; known are {known}",
        )

    def _not_finite(self, bits: int) -> Fault:
        what = "not a number (NaN)" if isnan(float_of(bits, self.type)) else "infinite"
        return Fault(FaultCode.NOT_FINITE, f"{self.name} is {what}: 0x{bits:0{4 * self.words}X}")

    def _tiny(self, bits: int) -> Fault:
        number = float_of(bits, self.type)
        message = (
            f"{self.name} {number:.3g} (0x{bits:0{4 * self.words}X}) is smaller than any sensor measures: is the "
            "register an integer, or the word order another? Look at the device's profile"
        )
        return Fault(FaultCode.OUT_OF_RANGE, message)

    def _outside(self, number: Number) -> Fault:
        message = f"{self.name} {spell(number, self.unit)} is outside {span(self.low, self.high, self.unit)}"
        return Fault(FaultCode.OUT_OF_RANGE, message)
