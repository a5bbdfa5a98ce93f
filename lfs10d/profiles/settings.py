"""A register that configures the device, and the contents that may be written to it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from lfs10d.profiles.decimals import Linear, span, spell
from lfs10d.profiles.facts import LAST_REGISTER, Range, Registered, Scale, Sentence, UnitText, Word, refuse
from lfs10d.schema.fields import Whole


class Setting(Registered):
    """A register that configures the device; written by request only, and only if marked `writable`.

    `range` is in `unit`, after `scale`; `values` tells what each register content that is allowed means.
    """

    name: Annotated[str, Word()] = Field(description="Its name.")
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
