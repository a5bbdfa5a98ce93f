"""Facts about the device itself: how it is recognised, and where its id and rate are set."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias, get_args

from pydantic import AfterValidator, Field, field_validator

from lfs10d.profiles.facts import LAST_REGISTER, Fact, Place, Register, Registered, Sentence, pair_of, refuse
from lfs10d.schema.fields import Whole

SlaveId: TypeAlias = Annotated[int, Whole(1, 255)]


def _ordered(ids: tuple[int, int]) -> tuple[int, int]:
    if ids[0] > ids[1]:
        refuse([((), "the first id is greater than the last")])
    return ids


SlaveIds: TypeAlias = Annotated[
    tuple[SlaveId, SlaveId],
    Field(strict=False),
    pair_of("the first and the last slave id, such as [1, 247]"),
    AfterValidator(_ordered),
]
Rate: TypeAlias = Literal[1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200]

MOST_WORDS = 125
"""Registers of one read (Modbus Application Protocol V1.1b3, section 6.3)."""


class Barrier(Registered):
    """A read whose answer has another length than any poll's, so that a late answer is never taken for it."""

    function: Literal[3, 4] = Field(3, description="3 reads holding registers, 4 input registers.")
    count: Annotated[int, Whole(1, MOST_WORDS)] = Field(description="Registers that it reads.")


class IdRegister(Registered):
    """Where the slave id is set; `locked_by` is what overrules it (`DIP switch`)."""

    locked_by: Sentence | None = Field(None, description="What overrules it, such as a DIP switch.")


class Identity(Registered):
    """A register that identifies a device of this profile; `holds` are its possible contents."""

    function: Literal[3, 4] = Field(3, description="3 reads holding registers, 4 input registers.")
    holds: Annotated[tuple[Annotated[int, Whole(0, LAST_REGISTER)], ...], Field(strict=False)] = Field(
        description="Its possible contents, a list: [0x0090]."
    )

    @field_validator("holds", mode="after")
    @classmethod
    def _names_a_content(cls, holds: tuple[int, ...]) -> tuple[int, ...]:
        if not holds:
            refuse([((), "names no content")])
        return holds


class RateRegister(Registered):
    """Where the baud rate is set."""

    codes: dict[int, Register] = Field(description="The register's content for each rate: {9600: 1, 19200: 2}.")
    locked_by: Sentence | None = Field(None, description="What overrules it, such as a DIP switch.")

    @field_validator("codes", mode="before")
    @classmethod
    def _are_of_rates(cls, codes: object) -> object:
        rates: tuple[int, ...] = get_args(Rate)
        wanted = " ".join(map(str, rates))
        keys = codes if isinstance(codes, dict) else {}
        refuse([((key,), f"is no baud rate; write one of {wanted}") for key in keys if key not in rates])
        return codes

    @field_validator("codes", mode="after")
    @classmethod
    def _differ(cls, codes: dict[int, int]) -> dict[int, int]:
        problems: list[tuple[Place, str]] = []
        if not codes:
            problems.append(((), "names no rate"))
        rates: dict[int, int] = {}
        for rate, code in codes.items():
            first = rates.setdefault(code, rate)
            if first != rate:
                problems.append(((rate,), f"{code} is the code of {first} already"))
        refuse(problems)
        return codes


class Factory(Fact):
    """Slave id and baud rate of a factory-new device; `line/adopt` looks for it there."""

    id: SlaveId = Field(description="Its slave id.")
    baudrate: Rate = Field(description="Its baud rate; it need not be among the rates that can be set.")
