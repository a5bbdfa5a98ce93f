"""What registers may hold, and the part that is meant."""

from __future__ import annotations

import pytest

from lfs10d.profiles.contents import (
    RegisterContent,
    bits_of,
    limits_of,
    no_content,
    part_of,
    part_problems,
    says_text,
    width_of,
)
from lfs10d.schema.fields import FieldError


def test_a_part_is_named_in_three_ways() -> None:
    assert part_of((3, 7), None, None, 16) == part_of(None, 0x00F8, None, 16) == (3, 5)
    assert (part_of(None, None, "high", 16), part_of(None, None, "low", 16)) == ((8, 8), (0, 8))
    assert part_of((0, 15), None, None, 16) is None
    assert part_of(None, None, None, 16) is None


@pytest.mark.parametrize(
    ("part", "width", "wrong"),
    [
        ((7, 3), 16, True), ((3, 16), 16, True), ((3, 16), 32, False), (0x1_0000, 16, True), (0x0F0F, 16, True),
        (0x0FF0, 16, False), ("high", 16, False), ("high", 32, True),
    ],
)  # fmt: skip
def test_a_part_must_lie_in_the_content(part: object, width: int, *, wrong: bool) -> None:
    assert bool(part_problems(part, width)) is wrong


def test_a_content_fits_its_type() -> None:
    assert no_content(0xFFFF, "uint16", 16) is None
    assert no_content(-1, "int16", 16) is None
    assert no_content(1.5, "float32", 32) is None
    assert no_content(-1, "uint16", 16) == "uint16 holds 0 to 0xFFFF, not -1"
    assert no_content(1.5, "uint16", 16) == "uint16 holds whole numbers only"
    assert (bits_of(-1, "int16", 16), bits_of(-9999.0, "float32", 32)) == (0xFFFF, 0xC61C3C00)
    assert (limits_of("int16", 16), limits_of("uint32", 32)) == ((-0x8000, 0x7FFF), (0, 0xFFFF_FFFF))
    assert (width_of("bool", None), width_of("uint64", None), width_of("string", 3)) == (1, 64, 48)


def test_text_and_booleans_are_told_from_numbers() -> None:
    assert says_text({"type": "string"})
    assert says_text({"function": 2})
    assert says_text({"type": "uint16", "map": {0: "dry"}})
    assert not says_text({"type": "uint16", "function": 3})


def test_a_content_is_a_number() -> None:
    assert (RegisterContent().accept(7), RegisterContent().accept(-9999.0)) == (7, -9999.0)
    for other in (True, "0xFFFF"):
        with pytest.raises(FieldError, match="must be a register content"):
            RegisterContent().accept(other)
