"""Kinds of values in files and requests, each with its error message and its JSON Schema.

A kind is the metadata of an annotated pydantic field: `interval: Annotated[float, Duration(0.02, 86400)]`.
Its `words` complete "must be ..." and are what the reference documentation prints.
"""

from __future__ import annotations

import json
import re
import unicodedata
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import field
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from lfs10d.schema.quantities import DURATION_PATTERN, SIZE_PATTERN, duration_text, seconds, size, size_text
from lfs10d.system.dataclass import dataclass

_SHOWN_CHARACTERS = 40

PLAIN_ERROR = "plain"
"""The type of a pydantic error whose message is already for a person."""


def plain_error(message: str) -> PydanticCustomError:
    """Return an error with this message; braces in it are no placeholders."""
    return PydanticCustomError(PLAIN_ERROR, "{message}", {"message": message})


def shown(value: object) -> str:
    """Return a wrong value in words on one line: its kind and its beginning, escaped."""
    match value:
        case None:
            return "empty"
        case bool():
            return "true" if value else "false"
        case int() | float():
            digits = repr(value) if isinstance(value, float) or abs(value) < 10**_SHOWN_CHARACTERS else "a huge number"
            return {"inf": ".inf", "-inf": "-.inf", "nan": ".nan"}.get(digits, digits)
        case str():
            return f"text {quoted(value)}"
        case Mapping():
            return "a mapping"
        case _:
            return "a list" if value else "an empty list"


def quoted(text: str, longest: int = _SHOWN_CHARACTERS) -> str:
    """Return text in double quotes on one line, shortened, with every character that does not print escaped."""
    cut = text if len(text) <= longest else text[: longest - 3] + "..."
    return "".join(
        character if character.isprintable() else json.dumps(character)[1:-1]
        for character in json.dumps(cut, ensure_ascii=False)
    )


class Hexadecimal(int):
    """A whole number that a file has in hexadecimal."""

    __slots__ = ()


class FieldError(ValueError):
    """A value is not of the kind; the message says what it must be."""


class FieldKind:
    """One kind of value."""

    @property
    @abstractmethod
    def words(self) -> str:
        """The kind in words; completes "must be ..."."""

    @abstractmethod
    def accept(self, value: object) -> object:
        """Return the value for the program; raise FieldError with the whole message if it is wrong."""

    def refusal(self, value: object) -> FieldError:
        """Return the error for this value."""
        return FieldError(f"must be {self.words}, not {shown(value)}")

    def json_schema(self) -> dict[str, Any]:
        """Return the JSON Schema of the ways to write it in a file; {} where there is none."""
        return {}

    def _validated(self, value: object) -> object:
        try:
            return self.accept(value)
        except FieldError as error:
            raise plain_error(str(error)) from None

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Let pydantic validate with `accept` alone."""
        return core_schema.no_info_plain_validator_function(self._validated)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return `json_schema`, whatever type the field has."""
        return self.json_schema()


def _or_null(schema: dict[str, Any], *, null: bool) -> dict[str, Any]:
    return {"anyOf": [schema, {"type": "null"}]} if null else schema


@dataclass(frozen=True)
class Whole(FieldKind):
    """A whole number within a range, both ends included."""

    first: int
    last: int

    @property
    def words(self) -> str:
        """Its range."""
        return f"a whole number from {self.first} to {self.last}"

    def accept(self, value: object) -> int:
        """Take integers only: neither text, true nor 9.0."""
        if isinstance(value, bool) or not isinstance(value, int) or not self.first <= value <= self.last:
            raise self.refusal(value)
        return value

    def json_schema(self) -> dict[str, Any]:
        """Return an integer with its range."""
        return {"type": "integer", "minimum": self.first, "maximum": self.last}


@dataclass(frozen=True)
class Flag(FieldKind):
    """True or false, in these words only."""

    words = "true or false"

    def accept(self, value: object) -> bool:
        """Take booleans only."""
        if not isinstance(value, bool):
            raise self.refusal(value)
        return value

    def json_schema(self) -> dict[str, Any]:
        """Return a boolean."""
        return {"type": "boolean"}


@dataclass(frozen=True)
class Choice(FieldKind):
    """One of a few values; `meaning` maps other spellings to values, `null` permits an empty one."""

    values: tuple[int | str, ...]
    null: bool = False
    meaning: Mapping[int | str, int | str] = field(default_factory=dict, hash=False)

    @property
    def words(self) -> str:
        """All of them."""
        *others, last = [str(value) for value in self.values] + (["null"] if self.null else [])
        return f"{', '.join(others)} or {last}" if others else last

    def accept(self, value: object) -> int | str | None:
        """Take a listed value of exactly its type: true is not 1, "9600" is not 9600."""
        if value is None and self.null:
            return None
        if isinstance(value, int | str) and not isinstance(value, bool):
            if value in self.meaning:
                return self.meaning[value]
            if value in self.values:
                return value
        raise self.refusal(value)

    def json_schema(self) -> dict[str, Any]:
        """Return the values, every way of writing each."""
        return {"enum": [*dict.fromkeys((*self.values, *self.meaning)), *([None] if self.null else [])]}


@dataclass(frozen=True)
class Duration(FieldKind):
    """Seconds within a range; `zero` adds 0, `auto` adds the word auto, which means None."""

    first: float
    last: float
    zero: str = ""
    auto: str = ""

    @property
    def words(self) -> str:
        """Its range, and how to write it."""
        words = f"a duration from {duration_text(self.first)} to {duration_text(self.last)}"
        words += f", or 0 ({self.zero})" if self.zero else ""
        words += f", or auto ({self.auto})" if self.auto else ""
        return f"{words}, written as 250ms, 1.5s, 5m, 24h, 7d or a number of seconds"

    def accept(self, value: object) -> float | None:
        """Take a number of seconds or text such as 250ms."""
        if self.auto and value == "auto":
            return None
        try:
            duration = seconds(value)
        except ValueError:
            raise self.refusal(value) from None
        if not (self.first <= duration <= self.last or (self.zero and duration == 0)):
            raise self.refusal(value)
        return duration

    def json_schema(self) -> dict[str, Any]:
        """Return a number of seconds within the range, or text of the form."""
        number = {"type": "number", "minimum": self.first, "maximum": self.last}
        others = [{"const": word} for word, allowed in ((0, self.zero), ("auto", self.auto)) if allowed]
        return {"anyOf": [number, {"type": "string", "pattern": DURATION_PATTERN}, *others]}


@dataclass(frozen=True)
class Size(FieldKind):
    """Bytes within a range."""

    first: int
    last: int

    @property
    def words(self) -> str:
        """Its range, and how to write it."""
        return f"a size from {size_text(self.first)} to {size_text(self.last)}, written as 512MB or a number of bytes"

    def accept(self, value: object) -> int:
        """Take a number of bytes or text such as 512MB."""
        try:
            count = size(value)
        except ValueError:
            raise self.refusal(value) from None
        if not self.first <= count <= self.last:
            raise self.refusal(value)
        return count

    def json_schema(self) -> dict[str, Any]:
        """Return a number of bytes within the range, or text of the form."""
        number = {"type": "integer", "minimum": self.first, "maximum": self.last}
        return {"anyOf": [number, {"type": "string", "pattern": SIZE_PATTERN}]}


@dataclass(frozen=True)
class Name(FieldKind):
    """A part of a topic, stable for life."""

    pattern = re.compile(r"[a-z0-9_-]{1,32}")

    words = "a name of 1 to 32 of the characters a-z 0-9 _ -"

    def accept(self, value: object) -> str:
        """Take text that fits."""
        if not isinstance(value, str) or self.pattern.fullmatch(value) is None:
            raise self.refusal(value)
        return value

    def json_schema(self) -> dict[str, Any]:
        """Return text with the pattern."""
        return {"type": "string", "pattern": f"^{self.pattern.pattern}$"}


@dataclass(frozen=True)
class Text(FieldKind):
    """Free text on one line: no control characters, not empty; `null` lets it be absent."""

    longest: int
    what: str = "text"
    null: bool = False

    @property
    def words(self) -> str:
        """Its length."""
        words = f"{self.what} of 1 to {self.longest} characters on one line, without control characters"
        return f"{words}, or null" if self.null else words

    def accept(self, value: object) -> str | None:
        """Take text that prints on one line."""
        if value is None and self.null:
            return None
        if not isinstance(value, str) or not 1 <= len(value) <= self.longest or not one_line(value):
            raise self.refusal(value)
        return value

    def json_schema(self) -> dict[str, Any]:
        """Return text with its length."""
        return _or_null({"type": "string", "minLength": 1, "maxLength": self.longest}, null=self.null)


def one_line(text: str) -> bool:
    """Return whether text has no control character and no line break."""
    return all(unicodedata.category(character) not in {"Cc", "Cs", "Zl", "Zp"} for character in text)


@dataclass(frozen=True)
class FilePath(Text):
    """The path of a file."""

    longest: int = 4096
    what: str = "a path"

    def accept(self, value: object) -> str | None:
        """Take text that can be a path, not an address such as tcp://..."""
        path = super().accept(value)
        if path is not None and "://" in path:
            raise FieldError("must be a path in the file system; network addresses are not supported")
        return path

    def json_schema(self) -> dict[str, Any]:
        """Return text with its length and without ://."""
        text = {"type": "string", "minLength": 1, "maxLength": self.longest, "pattern": "^(?!.*://)"}
        return _or_null(text, null=self.null)
