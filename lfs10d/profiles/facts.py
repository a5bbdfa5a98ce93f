"""The base of every fact of a profile, and its kinds of words and numbers."""

from __future__ import annotations

import re
from typing import Annotated, TypeAlias

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import InitErrorDetails

from lfs10d.profiles.manual_numbers import hint_for_number
from lfs10d.schema.fields import FieldError, FieldKind, Text, Whole, plain_error, shown
from lfs10d.system.dataclass import dataclass

Place: TypeAlias = tuple[str | int, ...]

RESERVED_NAMES = frozenset(
    (
        "v", "line", "device", "boot", "seq", "ts", "time", "clock", "unit", "units", "quality", "error", "rtt_ms",
        "errors", "ages", "historical",
    )
)  # fmt: skip
"""Keys of a sample; value names stand flat beside them."""

LAST_REGISTER = 0xFFFF
"""Register addresses have 16 bits (Modbus Application Protocol V1.1b3, section 4.4)."""

LARGEST_FACTOR = 1e12
"""Bound of scale and offset, and of 1 / scale: every result of a 64-bit value stays finite."""


def refuse(problems: list[tuple[Place, str]]) -> None:
    """Raise pydantic's ValidationError with each problem at its own place, if there are any."""
    if problems:
        raise ValidationError.from_exception_data(
            "profile",
            [InitErrorDetails(type=plain_error(message), loc=place, input=None) for place, message in problems],
        )


@dataclass(frozen=True)
class Word(FieldKind):
    """A name in snake_case that is not among the `reserved` ones."""

    reserved: frozenset[str] = frozenset()
    pattern = re.compile(r"[a-z][a-z0-9_]{0,47}")

    words = "a name of 1 to 48 of the characters a-z 0-9 _ that begins with a letter"

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

    words = "a number from 1e-12 to 1e12, or its negative"

    def accept(self, value: object) -> float:
        """Take numbers only."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.refusal(value)
        if not 1 / LARGEST_FACTOR <= abs(value) <= LARGEST_FACTOR:
            raise self.refusal(value)
        return float(value)


@dataclass(frozen=True)
class Address(Whole):
    """The address of a register on the wire; a number of the manual is refused with what it stands for."""

    def refusal(self, value: object) -> FieldError:
        """Return the error for this value."""
        hint = hint_for_number(value) if isinstance(value, int) else None
        return FieldError(f"must be {self.words}{f'; {hint}' if hint else f', not {shown(value)}'}")


Sentence: TypeAlias = Annotated[str, Text(500)]
UnitText: TypeAlias = Annotated[str, Text(16, what="a unit ('1' for a bare number)")]
Register: TypeAlias = Annotated[int, Whole(0, LAST_REGISTER)]
RegisterAddress: TypeAlias = Annotated[int, Address(0, LAST_REGISTER)]
Scale: TypeAlias = Annotated[float, Factor()]
Offset: TypeAlias = Annotated[float, Field(ge=-LARGEST_FACTOR, le=LARGEST_FACTOR)]


PAIR = 2


def pair_of(words: str) -> BeforeValidator:
    """Return the check that a key has a list of two; `words` say which two, with an example."""

    def two(value: object) -> object:
        if not isinstance(value, list | tuple) or len(value) != PAIR:
            refuse([((), f"must be {words}, not {shown(value)}")])
        return value

    return BeforeValidator(two)


def _ordered(bounds: tuple[float, float]) -> tuple[float, float]:
    if not bounds[0] < bounds[1]:
        refuse([((), "the first number of a range must be less than the second")])
    return bounds


Range: TypeAlias = Annotated[
    tuple[float, float],
    Field(strict=False),
    pair_of("the least and the greatest number, such as [0, 60]"),
    AfterValidator(_ordered),
]


class Facts(BaseModel):
    """Strict and frozen: no guessing of types, no unknown keys, no NaN, no change after loading."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class Fact(Facts):
    """Something the maker states: `source` says where; `unverified`: nobody has seen it on hardware."""

    source: Sentence | None = Field(None, description="Where the maker states it.")
    unverified: bool = Field(default=False, description="Not verified on hardware or in the source documents.")
    notes: Sentence | None = Field(None, description="What else a person should know.")


class Registered(Fact):
    """A fact about one register; its key in the file is `register`.

    pydantic's metaclass, an ABCMeta, has a method `register`: a field of that name inherits it as its default.
    """

    address: RegisterAddress = Field(
        alias="register", description="The (first) register's address on the wire, 0 to 0xFFFF."
    )

    @property
    def register(self) -> int:
        """The (first) register's address on the wire."""
        return self.address
