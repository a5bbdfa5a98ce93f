"""A value of a profile: its registers, how they become a number, a word or a boolean, and its range."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, PrivateAttr, ValidationInfo, field_validator

from lfs10d.profiles.calibration import Calibration
from lfs10d.profiles.cells import Cell
from lfs10d.profiles.contents import (
    BIT_FUNCTIONS,
    WORD_BITS,
    RegisterContent,
    bits_of,
    limits_of,
    no_content,
    part_of,
    part_problems,
    says_text,
    width_of,
    words_of,
)
from lfs10d.profiles.decimals import Linear
from lfs10d.profiles.facts import LAST_REGISTER, Offset, Range, Registered, Scale, UnitText, Word, pair_of, refuse
from lfs10d.profiles.facts import RESERVED_NAMES as RESERVED
from lfs10d.profiles.register_types import INTEGERS, SIGNED, WORDS, ByteOrder, RegisterType, WordOrder
from lfs10d.reading import Number
from lfs10d.schema.fields import Duration, Text, Whole, quoted, shown

ReadFunction: TypeAlias = Literal[1, 2, 3, 4]

TYPES_OF_NUMBERS = "int16, uint16, int32, uint32, int64, uint64, float32, float64, bcd or string"
NO_UNIT = "1"
"""The unit of a bare number, and of text and booleans."""
WIND_SPEED = "wind_speed"
"""The name of a wind speed, and its device class."""
LONGEST = {"bcd": 4, "string": 60}
"""Most registers of a value of these types; other types have a fixed number."""


Contents: TypeAlias = Annotated[tuple[Annotated[int | float, RegisterContent()], ...], Field(strict=False)]
Bits: TypeAlias = Annotated[
    tuple[Annotated[int, Whole(0, 63)], Annotated[int, Whole(0, 63)]],
    Field(strict=False),
    pair_of("the first and the last bit, such as [3, 7]"),
]
MappedWord: TypeAlias = Annotated[str, Text(64)]


class Value(Registered):
    """A measured value: its registers, how they become a value, and its range.

    `number = content * scale + offset` in `unit`, wrapped to `modulo`; a number outside `range` is `out_of_range`, one
    of the contents of `unavailable` is no value. With `map` the content becomes a word, by function 1 or 2 a boolean.
    `precision` (decimals) and `device_class` (Home Assistant's word) are for displays and change no value.
    """

    name: Annotated[str, Word(RESERVED)] = Field(description="Its key in samples.")
    function: ReadFunction = Field(
        3, description="3 reads holding registers, 4 input registers, 1 coils, 2 discrete inputs (both are booleans)."
    )
    type: RegisterType = Field(
        None, validate_default=True, description=f"{TYPES_OF_NUMBERS}. Required, but left out with function 1 or 2."
    )
    length: Annotated[int, Whole(1, 60)] | None = Field(
        None, validate_default=True, description="Registers that a string fills, or a bcd of more than one."
    )
    word_order: WordOrder | None = Field(
        None,
        validate_default=True,
        description="high_first or low_first: which of several registers holds the high part.",
    )
    byte_order: ByteOrder = Field("big", description="big, or little: the bytes within each register swapped.")
    bits: Bits | None = Field(
        None, description="First and last bit of the register's content that are the value; 0 is the lowest."
    )
    mask: Annotated[int, Whole(1, (1 << 64) - 1)] | None = Field(
        None, description="The same by a mask: 0x0FF0 means bits 4 to 11."
    )
    byte: Literal["high", "low"] | None = Field(
        None, description="high or low: the byte of the register that is the value."
    )
    map: dict[int, MappedWord] | None = Field(
        None, description="A word for each content, published in place of the number: {0: dry, 1: rain}."
    )
    unavailable: Contents = Field((), description="Contents that mean 'no value': [0xFFFF, 0x8000].")
    optional: bool = Field(default=False, description="The device may lack it: exception 02 is no error of the poll.")
    scale: Scale = Field(1.0, description="What the register's content is multiplied by.")
    offset: Offset = Field(0.0, description="What is added after the scale.")
    modulo: Annotated[float, Field(gt=0, le=1e12)] | None = Field(
        None, description="Numbers wrap around here: 360 for a direction. After scale, offset and calibration."
    )
    unit: UnitText = Field(
        None,
        validate_default=True,
        description="The unit of the number ('1' for a bare one); required, but left out for text and booleans.",
    )
    range: Range | None = Field(None, description="Least and greatest valid number; others are out_of_range.")
    precision: Annotated[int, Whole(0, 9)] | None = Field(None, description="Decimals on a display.")
    device_class: Annotated[str, Word()] | None = Field(None, description="Home Assistant's word for its kind.")
    interval: Annotated[float, Duration(0.02, 86400)] | None = Field(
        None, description="How often it is polled, where that is less often than the device."
    )

    _calibration: Calibration | None = PrivateAttr(None)
    _shows_raw: bool = PrivateAttr(default=False)

    # A field's validator sees those fields above it that have no error, so that each problem is found at once.

    @field_validator("type", mode="before")
    @classmethod
    def _has_a_type_unless_it_is_a_bit(cls, kind: object, info: ValidationInfo) -> object:
        if info.data.get("function") in BIT_FUNCTIONS:
            if kind is not None:
                refuse([((), "function 1 and 2 read booleans; leave the type out")])
            return "bool"
        if kind is None:
            refuse([((), f"is missing; write here: {TYPES_OF_NUMBERS}")])
        if kind == "bool":
            refuse([((), "registers hold no booleans; write uint16 with bits and map, or function 1 or 2")])
        if kind not in (*WORDS, *LONGEST):
            refuse([((), f"must be one of {TYPES_OF_NUMBERS}, not {shown(kind)}")])
        return kind

    @field_validator("type", mode="after")
    @classmethod
    def _ends_within_the_registers(cls, kind: RegisterType, info: ValidationInfo) -> RegisterType:
        words = WORDS.get(kind, 1)
        if info.data.get("address", 0) + words > LAST_REGISTER + 1:
            count = {2: "two", 4: "four"}[words]
            refuse([((), f"{kind} fills {count} registers, and 0xFFFF is the last")])
        return kind

    @field_validator("length", mode="after")
    @classmethod
    def _has_a_length_if_itis_text(cls, length: int | None, info: ValidationInfo) -> int | None:
        kind: RegisterType | None = info.data.get("type")
        if kind is None:
            return length
        most = LONGEST.get(kind)
        if most is None and length is not None:
            refuse([((), f"{kind} has its own length; leave it out")])
        if kind == "string" and length is None:
            refuse([((), "is missing; write how many registers the text fills")])
        if most is not None and length is not None:
            if length > most:
                refuse([((), f"must be a whole number from 1 to {most} for {kind}, not {length}")])
            if info.data.get("address", 0) + length > LAST_REGISTER + 1:
                refuse([((), f"{length} registers from there, and 0xFFFF is the last")])
        return length

    @field_validator("word_order", mode="after")
    @classmethod
    def _has_a_word_order_if_it_has_words(cls, order: WordOrder | None, info: ValidationInfo) -> WordOrder | None:
        kind: RegisterType | None = info.data.get("type")
        words = words_of(kind, info.data.get("length")) if kind else 1
        if kind == "string":
            if order is not None:
                refuse([((), "text begins in its first register; leave the word order out")])
        elif kind and words == 1 and order is not None:
            refuse([((), f"{kind} fills one register; leave the word order out")])
        elif kind and words > 1 and order is None:
            refuse([((), "is missing; write high_first or low_first: which of two registers holds the high half")])
        return order

    @field_validator("byte_order", "bits", "mask", "byte", mode="after")
    @classmethod
    def _is_a_part_of_a_whole_number(cls, part: object, info: ValidationInfo) -> object:
        kind: RegisterType | None = info.data.get("type")
        if part is None or kind is None or part == "big":
            return part
        if info.field_name == "byte_order":
            if kind == "bool":
                refuse([((), "a boolean has no bytes; leave the byte order out")])
            return part
        if kind not in INTEGERS:
            refuse([((), f"selects a part of a whole number, and the type is {kind}")])
        others = [key for key in ("bits", "mask") if info.data.get(key) is not None]
        if others:
            refuse([((), f"{others[0]} selects the part already")])
        refuse([((), problem) for problem in part_problems(part, WORD_BITS * WORDS[kind])])
        return part

    @field_validator("map", mode="after")
    @classmethod
    def _names_contents(cls, words: dict[int, str] | None, info: ValidationInfo) -> dict[int, str] | None:
        kind: RegisterType | None = info.data.get("type")
        if words is not None and kind is not None:
            if kind not in {*INTEGERS, "bool"}:
                refuse([((), f"a map is for whole numbers, and the type is {kind}")])
            if not words:
                refuse([((), "names no content")])
        return words

    @field_validator("unavailable", mode="after")
    @classmethod
    def _are_contents(cls, contents: tuple[int | float, ...], info: ValidationInfo) -> tuple[int | float, ...]:
        kind: RegisterType | None = info.data.get("type")
        if kind is not None:
            width = width_of(kind, info.data.get("length"))
            refuse([((place,), why) for place, each in enumerate(contents) if (why := no_content(each, kind, width))])
        return contents

    @field_validator("scale", "offset", "modulo", "range", "precision", mode="after")
    @classmethod
    def _is_of_a_number(cls, wanted: Any, info: ValidationInfo) -> Any:  # noqa: ANN401 - a field's value
        usual = {"scale": 1.0, "offset": 0.0}.get(str(info.field_name))
        if wanted != usual and says_text(info.data):
            refuse([((), "is for numbers, and this value is text or a boolean; leave it out")])
        return wanted

    @field_validator("unit", mode="before")
    @classmethod
    def _has_a_unit_unless_itis_text(cls, unit: object, info: ValidationInfo) -> object:
        if unit is not None:
            return unit
        if not says_text(info.data) and "map" in info.data:
            refuse([((), "is missing; write here: the unit of the number, '1' for a bare one")])
        return NO_UNIT

    @property
    def words(self) -> int:
        """The number of its registers (bits, with function 1 or 2)."""
        return words_of(self.type, self.length)

    @property
    def end(self) -> int:
        """The register after its last."""
        return self.register + self.words

    @property
    def doubts(self) -> Iterator[str]:
        """Probable mistakes: a unit of a word or text, a word for a content that its registers cannot hold."""
        if self.is_text and self.unit != NO_UNIT:
            yield f"is text or a boolean, which has no unit: leave out unit {quoted(self.unit)}"
        width = width_of(self.type, self.length)
        part = part_of(self.bits, self.mask, self.byte, width)
        low, high = limits_of(self.type, part.width if part else width)
        never = [content for content in self.map or () if not low <= content <= high]
        if never:
            yield f"map names {never[0]}, and the content is {low} to {high}"

    @property
    def is_text(self) -> bool:
        """Whether it is published as text or as a boolean, not as a number."""
        return says_text(self.__dict__)

    @property
    def is_wind_speed(self) -> bool:
        """Whether it is a wind speed: by its name, or by its device class."""
        return WIND_SPEED in (self.name, self.device_class)

    def calibrated(self, scale: Number, offset: Number, *, shows_raw: bool = False) -> Value:
        """Return the value with a calibration of `number * scale + offset`; a wind speed of 0 stays 0.

        `shows_raw`: its range is that of the calibrated number, and what is shown is the one without calibration.
        """
        value = self.model_copy()
        value._shows_raw = shows_raw  # noqa: SLF001 - its own copy
        value._calibration = Calibration(scale, offset, keeps_zero=self.is_wind_speed)  # noqa: SLF001 - its own copy
        return value

    def cell(self, address: int) -> Cell:
        """Return where it lies in a read that begins at register `address`."""
        low, high = self.range or (None, None)
        width = width_of(self.type, self.length)
        part = part_of(self.bits, self.mask, self.byte, width)
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
            words=self.words,
            part=part,
            signed_from=1 << (part.width if part else width) - 1 if self.type in SIGNED else 0,
            texts=self.map,
            unavailable=frozenset(bits_of(each, self.type, width) for each in self.unavailable),
            modulo=self.modulo,
            calibration=self._calibration,
            shows_raw=self._shows_raw,
        )
