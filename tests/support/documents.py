"""Documents and the problems found in them."""

from __future__ import annotations

from typing import Annotated, Literal

import pytest
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from lfs10d.schema.document import parse
from lfs10d.schema.fields import Whole


def problems(text: str) -> list[str]:
    return [str(problem) for problem in parse(text, "f").problems]


class Inner(BaseModel):
    """A section."""

    model_config = ConfigDict(strict=True, extra="forbid")

    number: Annotated[int, Whole(1, 9)] = Field(1, description="One to nine.")
    needed: str = Field("", description="The needed thing.")
    required: int = Field(description="A number that must be there.")
    bare: int = 0


def _odd(value: int) -> int:
    if value % 2 == 0:
        raise ValueError("must be\nodd")
    return value


class Bare(BaseModel):
    """Keys without a description."""

    thing: int


class Outer(BaseModel):
    """A file."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)

    inner: Inner | None = None
    many: list[Inner] = []
    union: int | Literal["x"] = 0
    mixed: list[int] | dict[str, int] = []
    ratio: float = Field(0.0, ge=0, lt=5)
    odd: Annotated[int, AfterValidator(_odd)] = 1
    codes: dict[Annotated[int, Field(ge=100)], int] = {}
    flag: bool = False
    name: Annotated[str, Field(pattern="^a")] = "a"
    register_: int = Field(0, alias="register")
    bare: Bare | None = None
    other: list[Bare] = []


def found(text: str, model: type[BaseModel] | None = Outer) -> list[str]:
    document = parse(text, "f")
    with pytest.raises(ValidationError) as invalid:
        Outer.model_validate(document.data)
    return [str(problem) for problem in document.problems_of(invalid.value, model)]
