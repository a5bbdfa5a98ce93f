"""One fact of a profile: a value to be read, a setting, and the words both are written in."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from lfs10d.kinds import PLAIN_ERROR, Kind, RefusedError, Text, Whole
from lfs10d.profiles.registers import WORDS, ByteOrder, Cell, Linear, RegisterType, WordOrder, span, spell

Place: TypeAlias = tuple[str | int, ...]
ReadFunction: TypeAlias = Literal[3, 4]

RESERVED_NAMES = frozenset(
    {
        "v",
        "line",
        "device",
        "boot",
        "seq",
        "ts",
        "time",
        "clock",
        "unit",
        "units",
        "quality",
        "error",
        "rtt_ms",
    }
    | {"historical"}
)
"""Keys of a sample; value names stand flat beside them."""

LARGEST_FACTOR = 1e12
"""Bound of scale and offset, and of 1 / scale: every result of a 32-bit value stays finite."""


def refuse(problems: list[tuple[Place, str]]) -> None:
    """Raise pydantic's ValidationError with each problem at its own place, if there are any."""
    if problems:
        raise ValidationError.from_exception_data(
            "profile",
            [
                InitErrorDetails(
                    # As a value of the context: braces in the message are no placeholders.
                    type=PydanticCustomError(PLAIN_ERROR, "{message}", {"message": message}),
                    loc=place,
                    input=None,
                )
                for place, message in problems
            ],
        )


@dataclass(frozen=True)
class Word(Kind):
    """A name in snake_case that is not among the `reserved` ones."""

    reserved: frozenset[str] = frozenset()
    pattern = re.compile(r"[a-z][a-z0-9_]{0,47}")

    @property
    def words(self) -> str:
        """Its characters."""
        return "a name of 1 to 48 of the characters a-z 0-9 _ that begins with a letter"

    def accept(self, value: object) -> str:
        """Take text that fits."""
        if not isinstance(value, str) or self.pattern.fullmatch(value) is None:
            raise self.refusal(value)
        if value in self.reserved:
            raise RefusedError(f"is a key of every sample already; choose another, such as raw_{value}")
        return value


@dataclass(frozen=True)
class Factor(Kind):
    """A scale: not zero, and of a size that keeps every result finite."""

    @property
    def words(self) -> str:
        """Its range."""
        return "a number from 1e-12 to 1e12, or the same negative"

    def accept(self, value: object) -> float:
        """Take numbers only."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.refusal(value)
        if not 1 / LARGEST_FACTOR <= abs(value) <= LARGEST_FACTOR:
            raise self.refusal(value)
        return float(value)


Sentence: TypeAlias = Annotated[str, Text(500)]
UnitText: TypeAlias = Annotated[str, Text(16, what="a unit ('1' for a bare number)")]
Register: TypeAlias = Annotated[int, Whole(0, 0xFFFF)]
Scale: TypeAlias = Annotated[float, Factor()]
Offset: TypeAlias = Annotated[float, Field(ge=-LARGEST_FACTOR, le=LARGEST_FACTOR)]
Range: TypeAlias = Annotated[tuple[float, float], Field(strict=False)]


class Facts(BaseModel):
    """Strict and frozen: no guessing of types, no unknown keys, no NaN, no change after loading."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class Fact(Facts):
    """Something the maker states: `source` is where, `unverified` that nobody has seen it on hardware."""

    source: Sentence | None = None
    unverified: bool = False
    notes: Sentence | None = None


with warnings.catch_warnings():
    # pydantic warns because its metaclass, an ABCMeta, has a method of that name; no instance ever sees it.
    warnings.filterwarnings("ignore", 'Field name "register"', UserWarning)

    class Registered(Fact):
        """A fact about one place: `register` is the (first) register's address on the wire."""

        register: Register


def _ordered(bounds: Range | None) -> list[tuple[Place, str]]:
    if bounds is None or bounds[0] < bounds[1]:
        return []
    return [(("range",), "the first number of a range must be less than the second")]


class Value(Registered):
    """A measured value: where it lies, how it becomes a number, and which numbers are believed.

    `number = register * scale + offset` in `unit`; a number outside `range` is published as `out_of_range`.
    `precision` (decimals) and `device_class` (Home Assistant's word) are for displays and change no value.
    """

    name: Annotated[str, Word(RESERVED_NAMES)]
    function: ReadFunction = 3
    type: RegisterType
    word_order: WordOrder | None = None
    byte_order: ByteOrder = "big"
    scale: Scale = 1.0
    offset: Offset = 0.0
    unit: UnitText
    range: Range | None = None
    precision: Annotated[int, Whole(0, 9)] | None = None
    device_class: Annotated[str, Word()] | None = None

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        problems = _ordered(self.range)
        if self.words == 1 and self.word_order is not None:
            problems.append((("word_order",), f"{self.type} fills one register; leave the word order out"))
        if self.words > 1 and self.word_order is None:
            wanted = "high_first or low_first: which of the two registers holds the high half"
            problems.append((("word_order",), f"is missing; write {wanted}"))
        if self.end > 0x1_0000:  # noqa: PLR2004 - register addresses have 16 bits
            problems.append((("register",), f"{self.type} fills two registers; 0xFFFF is the last"))
        refuse(problems)
        return self

    @property
    def words(self) -> int:
        """Registers it fills."""
        return WORDS[self.type]

    @property
    def end(self) -> int:
        """The register after its last."""
        return self.register + self.words

    def cell(self, address: int) -> Cell:
        """Return where it lies in a read that begins at register `address`."""
        low, high = self.range or (None, None)
        return Cell(
            name=self.name,
            unit=self.unit,
            offset=self.register - address,
            type=self.type,
            word_order=self.word_order or "high_first",
            byte_order=self.byte_order,
            linear=Linear.of(self.scale, self.offset),
            low=low,
            high=high,
        )


class Setting(Registered):
    """A register that configures the device; written by request only, and only if marked `writable`.

    `range` is in `unit`, after `scale`; `values` gives each register content that is allowed a name.
    """

    name: Annotated[str, Word()]
    type: Literal["int16", "uint16"] = "uint16"
    scale: Scale = 1.0
    unit: UnitText = "1"
    range: Range | None = None
    values: dict[str, Register] | None = None
    writable: bool = False

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        problems = _ordered(self.range)
        if self.range is not None and self.values is not None:
            problems.append((("values",), "a setting has either a range or values"))
        if self.values == {}:
            problems.append((("values",), "names no value"))
        if self.writable and self.range is None and self.values is None:
            problems.append((("writable",), "a setting is writable only with a range or values"))
        refuse(problems)
        return self

    def refusal(self, word: int) -> str | None:
        """Return why the register content `word` (0..65535) must not be written; None if it may be."""
        if not self.writable:
            return f"{self.name} is not marked writable by the profile"
        if self.values is not None and word not in self.values.values():
            allowed = ", ".join(f"{code} ({meaning})" for meaning, code in self.values.items())
            return f"{self.name} takes {allowed}, not {word}"
        if self.range is not None:
            low, high = self.range
            number = Linear.of(self.scale, 0).of_integer(word - (word >> 15 << 16) if self.type == "int16" else word)
            if not low <= number <= high:
                content = f"register content {word} is {spell(number, self.unit)}"
                return f"{self.name} takes {span(low, high, self.unit)}; {content}"
        return None
