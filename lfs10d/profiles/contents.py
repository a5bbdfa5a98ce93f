"""The contents that a value's registers can hold, and the part of them that is the value. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lfs10d.profiles.cells import Part
from lfs10d.profiles.decimals import float_bits
from lfs10d.profiles.register_types import SIGNED, WORDS, RegisterType
from lfs10d.schema.fields import FieldKind
from lfs10d.system.dataclass import dataclass

BIT_FUNCTIONS = (1, 2)
"""Functions that read coils and discrete inputs: booleans."""
FLOATS = ("float32", "float64")
WORD_BITS = 16


@dataclass(frozen=True)
class RegisterContent(FieldKind):
    """A register content; for a float type a number with a decimal point is that number itself."""

    words = "a register content such as 0xFFFF, or the number that stands for no value"

    def accept(self, value: object) -> int | float:
        """Take numbers only."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.refusal(value)
        return value


def words_of(kind: RegisterType, length: int | None) -> int:
    """Return the number of registers of a value."""
    return length or WORDS.get(kind, 1)


def width_of(kind: RegisterType, length: int | None) -> int:
    """Return the number of bits of a value's content."""
    return 1 if kind == "bool" else WORD_BITS * words_of(kind, length)


def says_text(data: Mapping[str, Any]) -> bool:
    """Return whether a value with these keys is text or a boolean."""
    if data.get("function") in BIT_FUNCTIONS or data.get("map") is not None:
        return True
    return data.get("type") == "string"


def part_problems(part: object, width: int) -> list[str]:
    """Return the problems of a part of a whole number of `width` bits."""
    if isinstance(part, tuple):
        if part[0] > part[1]:
            return ["the first bit is greater than the last"]
        return [f"must be bits 0 to {width - 1}"] if part[1] >= width else []
    if isinstance(part, int):
        ones = part >> (part & -part).bit_length() - 1
        if part >= 1 << width:
            return [f"has more than the {width} bits there are"]
        return ["must be one run of ones, such as 0x0FF0"] if ones & ones + 1 else []
    return [] if width == WORD_BITS else ["is for values of one register; write bits or mask"]


def part_of(bits: tuple[int, int] | None, mask: int | None, byte: str | None, width: int) -> Part | None:
    """Return the part of a content of `width` bits that is the value; None for all of it."""
    if byte is not None:
        bits = (8, 15) if byte == "high" else (0, 7)
    if mask is not None:
        bits = ((mask & -mask).bit_length() - 1, mask.bit_length() - 1)
    if bits is None or bits == (0, width - 1):
        return None
    return Part(bits[0], bits[1] - bits[0] + 1)


def no_content(content: float, kind: RegisterType, width: int) -> str | None:
    """Return why a value of this type cannot hold this content; None if it can."""
    low = -(1 << width - 1) if kind in SIGNED else 0
    if not isinstance(content, int):
        return None if kind in FLOATS else f"{kind} holds whole numbers only"
    if not low <= content < 1 << width:
        return f"{kind} holds {low} to 0x{(1 << width) - 1:X}, not {content}"
    return None


def limits_of(kind: RegisterType, width: int) -> tuple[int, int]:
    """Return the least and the greatest whole number of this type in `width` bits."""
    low = -(1 << width - 1) if kind in SIGNED else 0
    return low, low + (1 << width) - 1


def bits_of(content: float, kind: RegisterType, width: int) -> int:
    """Return a content as its bits; a float with a decimal point is the number itself."""
    if not isinstance(content, int):
        return float_bits(content, kind)
    return content % (1 << width)
