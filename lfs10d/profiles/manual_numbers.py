"""Numbers that manuals print for registers (40001, 300010), written where an address belongs. Pure.

A manual's first digit names the table, the rest counts from one: 40001 is the holding register at address 0
(Modbus Application Protocol V1.1b3, section 4.4: data are numbered from 1, addressed from 0).
"""

from __future__ import annotations

from typing import Final

TABLES: Final = {1: ("discrete input", 2), 3: ("input register", 4), 4: ("holding register", 3)}
"""By the first digit: its meaning, and the function that reads it."""
FIVE_DIGITS: Final = 10_000
SIX_DIGITS: Final = 100_000
LAST_ADDRESS: Final = 0xFFFF
DEFAULT_FUNCTION: Final = 3
ROUND: Final = 0x1000
"""Multiples of this are addresses that look like such numbers by chance: 0x8000 is 32768."""


def hint_for_number(number: int) -> str | None:
    """Return the meaning of a number of six digits that is no address; None if it has none."""
    digit, counted = divmod(number, SIX_DIGITS)
    if digit not in TABLES or not 1 <= counted <= LAST_ADDRESS + 1:
        return None
    return f"{number} looks like a number of the manual: {_meaning(digit, counted - 1, DEFAULT_FUNCTION)}"


def hint_for_address(address: int, function: int | None) -> str | None:
    """Return the probable meaning of an address that looks like a number of five digits; None for others.

    `function` reads it, None where nothing can be said of that. An address from 10001 to 19999 is doubted only of a
    discrete input: holding registers often lie there.
    """
    digit, counted = divmod(address, FIVE_DIGITS)
    if digit not in TABLES or counted == 0 or address % ROUND == 0 or (digit == 1 and function != TABLES[1][1]):
        return None
    meaning = _meaning(digit, counted - 1, function)
    hint = f"register {address} looks like a number of the manual, not an address: {meaning}"
    return f"{hint}; if it is the address, write it in hexadecimal: 0x{address:04X}"


def _meaning(digit: int, address: int, function: int | None) -> str:
    what, right = TABLES[digit]
    other = "" if function in (right, None) else f" and function: {right}"
    return f"{digit} stands for {what} there, and the rest counts from one, so write {address}{other}"
