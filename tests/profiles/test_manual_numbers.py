"""Numbers of a manual are known for what they are, and addresses are left alone."""

from __future__ import annotations

import pytest

from lfs10d.profiles.manual_numbers import hint_for_address, hint_for_number


@pytest.mark.parametrize(
    ("number", "meaning"),
    [
        (400_001, "4 stands for holding register there, and the rest counts from one, so write 0"),
        (465_536, "4 stands for holding register there, and the rest counts from one, so write 65535"),
        (300_010, "3 stands for input register there, and the rest counts from one, so write 9 and function: 4"),
        (100_001, "1 stands for discrete input there, and the rest counts from one, so write 0 and function: 2"),
    ],
)
def test_six_digits_are_a_table_and_a_number(number: int, meaning: str) -> None:
    assert hint_for_number(number) == f"{number} looks like a number of the manual: {meaning}"


@pytest.mark.parametrize("number", [400_000, 465_537, 200_001, 70_000, 1_000_001, -1])
def test_another_number_stands_for_nothing(number: int) -> None:
    assert hint_for_number(number) is None


@pytest.mark.parametrize(
    ("address", "function", "written"),
    [
        (40001, 3, "0"),
        (40001, 4, "0 and function: 3"),
        (49999, 3, "9998"),
        (30010, 3, "9 and function: 4"),
        (30010, 4, "9"),
        (30010, None, "9"),
        (10003, 2, "2"),
    ],
)
def test_an_address_that_looks_like_a_number_of_the_manual_is_doubted(
    address: int, function: int | None, written: str
) -> None:
    hint = hint_for_address(address, function)
    assert hint is not None
    assert hint.startswith(f"register {address} looks like a number of the manual, not an address: ")
    assert hint.endswith(f"so write {written}; if it is the address, write it in hexadecimal: 0x{address:04X}")


@pytest.mark.parametrize(
    ("address", "function"),
    [(0, 3), (500, 3), (10003, 3), (10003, None), (20001, 3), (30000, 4), (0x8000, 3), (0xA000, 3), (0xC000, 3)],
)
def test_other_addresses_are_left_alone(address: int, function: int | None) -> None:
    assert hint_for_address(address, function) is None
