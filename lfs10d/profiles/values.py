"""One fact of a profile: a value to be read, a setting, and the words both are written in."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, Literal, Self, TypeAlias

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from lfs10d.profiles.registers import WORDS, ByteOrder, Cell, Linear, RegisterType, WordOrder, span, spell

if TYPE_CHECKING:
    from collections.abc import Callable

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
                    type=PydanticCustomError("profile", "{wrong}", {"wrong": message}), loc=place, input=None
                )
                for place, message in problems
            ],
        )


def _worded(pattern: str, wanted: str) -> Callable[[str], str]:
    expression = re.compile(pattern)

    def check(text: str) -> str:
        if not expression.fullmatch(text):
            refuse([((), f"{text!r} is not {wanted}")])
        return text

    return check


def _value_name(text: str) -> str:
    if text in RESERVED_NAMES:
        refuse([((), f"{text!r} is a key of every sample; choose another name, such as 'raw_{text}'")])
    return text


ProfileName: TypeAlias = Annotated[
    str, AfterValidator(_worded(r"[a-z0-9_-]{1,32}", "a name of 1 to 32 of a-z 0-9 _ -"))
]
FactName: TypeAlias = Annotated[
    str,
    AfterValidator(
        _worded(r"[a-z][a-z0-9_]{0,47}", "a name of up to 48 of a-z 0-9 _ that begins with a letter")
    ),
]
ValueName: TypeAlias = Annotated[FactName, AfterValidator(_value_name)]
Text: TypeAlias = Annotated[
    str, AfterValidator(_worded(r"[^\x00-\x1f\x7f-\x9f]{1,500}", "one line of 1 to 500 characters"))
]
Unit: TypeAlias = Annotated[
    str,
    AfterValidator(
        _worded(r"\S{1,16}", "a unit of 1 to 16 characters without space ('1' for a bare number)")
    ),
]
Register: TypeAlias = Annotated[int, Field(ge=0, le=0xFFFF)]
Range: TypeAlias = Annotated[tuple[float, float], Field(strict=False)]


def _factor(number: float) -> float:
    if not 1 / LARGEST_FACTOR <= abs(number) <= LARGEST_FACTOR:
        refuse([((), f"{number!r} is no scale; it is 1e-12 to 1e12, or the same negative")])
    return number


class Facts(BaseModel):
    """Strict and frozen: no guessing of types, no unknown keys, no NaN, no change after loading."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class Fact(Facts):
    """Something the maker states: `source` is where, `unverified` that nobody has seen it on hardware."""

    source: Text | None = None
    unverified: bool = False
    notes: Text | None = None


class Registered(Fact):
    """A fact about one place: key `register`, the address on the wire, 0..0xFFFF.

    pydantic's metaclass has a method `register`, so the field itself cannot bear that name.
    """

    address: Register = Field(alias="register")

    @property
    def register(self) -> int:
        """The (first) register's address on the wire."""
        return self.address


def _ordered(bounds: Range | None) -> list[tuple[Place, str]]:
    if bounds is None or bounds[0] < bounds[1]:
        return []
    return [(("range",), "the first number of a range must be less than the second")]


class Value(Registered):
    """A measured value: where it lies, how it becomes a number, and which numbers are believed.

    `number = register * scale + offset` in `unit`; a number outside `range` is published as `out_of_range`.
    `precision` (decimals) and `device_class` (Home Assistant's word) are for displays and change no value.
    """

    name: ValueName
    function: ReadFunction = 3
    type: RegisterType
    word_order: WordOrder | None = None
    byte_order: ByteOrder = "big"
    scale: Annotated[float, AfterValidator(_factor)] = 1.0
    offset: Annotated[float, Field(ge=-LARGEST_FACTOR, le=LARGEST_FACTOR)] = 0.0
    unit: Unit
    range: Range | None = None
    precision: Annotated[int, Field(ge=0, le=9)] | None = None
    device_class: FactName | None = None

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        problems = _ordered(self.range)
        if self.words == 1 and self.word_order is not None:
            problems.append((("word_order",), f"an {self.type} fills one register and has no word order"))
        if self.words > 1 and self.word_order is None:
            wanted = "which register holds the high half? word_order: high_first or low_first"
            problems.append((("word_order",), f"missing; {wanted}"))
        if self.end > 0x1_0000:  # noqa: PLR2004 - register addresses have 16 bits
            problems.append((("register",), f"a {self.type} at 0xFFFF would end beyond the last register"))
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

    `range` is in `unit`, after `scale`; `values` names each register content that is allowed.
    """

    name: FactName
    type: Literal["int16", "uint16"] = "uint16"
    scale: Annotated[float, AfterValidator(_factor)] = 1.0
    unit: Unit = "1"
    range: Range | None = None
    values: dict[Register, Text] | None = None
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
        if self.values is not None:
            allowed = ", ".join(f"{code} ({meaning})" for code, meaning in self.values.items())
            return None if word in self.values else f"{self.name} takes {allowed}, not {word}"
        signed = word - (word >> 15 << 16) if self.type == "int16" else word
        low, high = self.range or (0.0, 0.0)
        number = Linear.of(self.scale, 0).of_integer(signed)
        if low <= number <= high:
            return None
        content = f"register content {word} is {spell(number, self.unit)}"
        return f"{self.name} takes {span(low, high, self.unit)}; {content}"
