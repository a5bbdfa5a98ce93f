"""One fact of a profile: a value to be read, a setting, and the words both are written in."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    field_validator,
)
from pydantic_core import InitErrorDetails

from lfs10d.profiles.calibration import Calibration
from lfs10d.profiles.registers import WORDS, ByteOrder, Cell, Linear, RegisterType, WordOrder, span, spell
from lfs10d.reading import Number
from lfs10d.schema.fields import FieldError, FieldKind, Text, Whole, plain_error

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
        "errors",
        "ages",
    }
    | {"historical"}
)
"""Keys of a sample; value names stand flat beside them."""

WIND_SPEED = "wind_speed"
"""The name of a wind speed, and its device class."""

LAST_REGISTER = 0xFFFF
"""Register addresses have 16 bits (Modbus Application Protocol V1.1b3, section 4.4)."""

LARGEST_FACTOR = 1e12
"""Bound of scale and offset, and of 1 / scale: every result of a 32-bit value stays finite."""


def refuse(problems: list[tuple[Place, str]]) -> None:
    """Raise pydantic's ValidationError with each problem at its own place, if there are any."""
    if problems:
        raise ValidationError.from_exception_data(
            "profile",
            [
                InitErrorDetails(
                    type=plain_error(message),
                    loc=place,
                    input=None,
                )
                for place, message in problems
            ],
        )


@dataclass(frozen=True)
class Word(FieldKind):
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
            raise FieldError(f"is a key of every sample already; choose another, such as raw_{value}")
        return value


@dataclass(frozen=True)
class Factor(FieldKind):
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
Register: TypeAlias = Annotated[int, Whole(0, LAST_REGISTER)]
Scale: TypeAlias = Annotated[float, Factor()]
Offset: TypeAlias = Annotated[float, Field(ge=-LARGEST_FACTOR, le=LARGEST_FACTOR)]


def _ordered(bounds: tuple[float, float]) -> tuple[float, float]:
    if not bounds[0] < bounds[1]:
        refuse([((), "the first number of a range must be less than the second")])
    return bounds


Range: TypeAlias = Annotated[tuple[float, float], Field(strict=False), AfterValidator(_ordered)]


class Facts(BaseModel):
    """Strict and frozen: no guessing of types, no unknown keys, no NaN, no change after loading."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class Fact(Facts):
    """Something the maker states: `source` is where, `unverified` that nobody has seen it on hardware."""

    source: Sentence | None = Field(None, description="Where the maker says so.")
    unverified: bool = Field(default=False, description="Nobody has seen it on hardware or in the source documents.")
    notes: Sentence | None = Field(None, description="What else a person should know.")


class Registered(Fact):
    """A fact about one place; in the file its key is `register`.

    pydantic's metaclass, an ABCMeta, has a method `register`: a field of that name inherits it as its default.
    """

    address: Register = Field(alias="register", description="The (first) register's address on the wire, 0 to 0xFFFF.")

    @property
    def register(self) -> int:
        """The (first) register's address on the wire."""
        return self.address


class Value(Registered):
    """A measured value: where it lies, how it becomes a number, and which numbers are believed.

    `number = register * scale + offset` in `unit`; a number outside `range` is published as `out_of_range`.
    `precision` (decimals) and `device_class` (Home Assistant's word) are for displays and change no value.
    """

    name: Annotated[str, Word(RESERVED_NAMES)] = Field(description="The key under which samples carry it.")
    function: ReadFunction = Field(3, description="3 reads holding registers, 4 input registers.")
    type: RegisterType = Field(description="int16, uint16, int32, uint32 or float32.")
    word_order: WordOrder | None = Field(
        None,
        validate_default=True,
        description="high_first or low_first: which of two registers holds the high half; 32 bits only.",
    )
    byte_order: ByteOrder = Field("big", description="big, or little: the bytes within each register swapped.")
    scale: Scale = Field(1.0, description="What the register's content is multiplied by.")
    offset: Offset = Field(0.0, description="What is added after the scale.")
    unit: UnitText = Field(description="The unit of the number; '1' for a bare one.")
    range: Range | None = Field(None, description="Least and greatest number that is believed.")
    precision: Annotated[int, Whole(0, 9)] | None = Field(None, description="Decimals on a display.")
    device_class: Annotated[str, Word()] | None = Field(None, description="Home Assistant's word for its kind.")
    _calibration: Calibration | None = PrivateAttr(None)

    # A field's validator sees those fields above it that have no error, so that each problem is found at once.

    @field_validator("type", mode="after")
    @classmethod
    def _ends_within_the_registers(cls, kind: RegisterType, info: ValidationInfo) -> RegisterType:
        if info.data.get("address", 0) + WORDS[kind] > LAST_REGISTER + 1:
            refuse([((), f"{kind} fills two registers, and 0xFFFF is the last")])
        return kind

    @field_validator("word_order", mode="after")
    @classmethod
    def _has_a_word_order_if_it_has_words(cls, order: WordOrder | None, info: ValidationInfo) -> WordOrder | None:
        kind: RegisterType | None = info.data.get("type")
        if kind and WORDS[kind] == 1 and order is not None:
            refuse([((), f"{kind} fills one register; leave the word order out")])
        if kind and WORDS[kind] > 1 and order is None:
            refuse([((), "is missing; write high_first or low_first: which of two registers holds the high half")])
        return order

    @property
    def words(self) -> int:
        """Registers it fills."""
        return WORDS[self.type]

    @property
    def end(self) -> int:
        """The register after its last."""
        return self.register + self.words

    @property
    def is_text(self) -> bool:
        """Whether it is published as text or as a boolean, not as a number."""
        return False

    @property
    def is_wind_speed(self) -> bool:
        """Whether it is a wind speed: by its name, or by its device class."""
        return WIND_SPEED in (self.name, self.device_class)

    def calibrated(self, scale: Number, offset: Number) -> Value:
        """Return the value of a device whose certificate says `number * scale + offset`; a wind speed of 0 stays 0."""
        value = self.model_copy()
        value._calibration = Calibration(scale, offset, keeps_zero=self.is_wind_speed)  # noqa: SLF001 - its own copy
        return value

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
            calibration=self._calibration,
        )


class Setting(Registered):
    """A register that configures the device; written by request only, and only if marked `writable`.

    `range` is in `unit`, after `scale`; `values` tells what each register content that is allowed means.
    """

    name: Annotated[str, Word()] = Field(description="What to call it.")
    type: Literal["int16", "uint16"] = Field("uint16", description="int16 or uint16.")
    scale: Scale = Field(1.0, description="What the register's content is multiplied by.")
    unit: UnitText = Field("1", description="The unit of the number; '1' for a bare one.")
    range: Range | None = Field(None, description="Least and greatest number that may be written, in the unit.")
    values: dict[int, Sentence] | None = Field(
        None, description="What each register content that may be written means; instead of a range."
    )
    writable: bool = Field(default=False, description="A request may write it, within its range or values.")

    @field_validator("values", mode="before")
    @classmethod
    def _are_of_contents(cls, values: object) -> object:
        keys = values if isinstance(values, dict) else {}
        content = Whole(0, LAST_REGISTER)
        wrong = [key for key in keys if not isinstance(key, int) or not content.first <= key <= content.last]
        refuse([((key,), f"is no register content; write {content.words}") for key in wrong])
        return values

    @field_validator("values", mode="after")
    @classmethod
    def _is_an_alternative(cls, values: dict[int, str] | None, info: ValidationInfo) -> dict[int, str] | None:
        if values == {}:
            refuse([((), "names no value")])
        if values is not None and info.data.get("range") is not None:
            refuse([((), "a setting has either a range or values")])
        return values

    @field_validator("writable", mode="after")
    @classmethod
    def _is_bounded_if_writable(cls, writable: bool, info: ValidationInfo) -> bool:  # noqa: FBT001 - pydantic's call
        known = "range" in info.data and "values" in info.data
        if writable and known and info.data["range"] is None and info.data["values"] is None:
            refuse([((), "a setting is writable only with a range or values")])
        return writable

    def refusal(self, word: int) -> str | None:
        """Return why the register content `word` (0..65535) must not be written; None if it may be."""
        if not self.writable:
            return f"{self.name} is not marked writable by the profile"
        if self.values is not None and word not in self.values:
            allowed = ", ".join(f"{code} ({meaning})" for code, meaning in self.values.items())
            return f"{self.name} takes {allowed}, not {word}"
        if self.range is not None:
            low, high = self.range
            number = Linear.of(self.scale, 0).of_integer(word - (word >> 15 << 16) if self.type == "int16" else word)
            if not low <= number <= high:
                content = f"register content {word} is {spell(number, self.unit)}"
                return f"{self.name} takes {span(low, high, self.unit)}; {content}"
        return None
