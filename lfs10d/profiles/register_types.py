"""The types of a value in registers: names, lengths, and the orders of their words and bytes.

The layouts of a 32-bit value ABCD (A the most significant byte) in two registers::

    word_order   byte_order big   byte_order little
    high_first   AB CD            BA DC
    low_first    CD AB            DC BA
"""

from __future__ import annotations

from typing import Literal, TypeAlias

RegisterType: TypeAlias = Literal[
    "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64", "bcd", "string", "bool"
]
WordOrder: TypeAlias = Literal["high_first", "low_first"]
ByteOrder: TypeAlias = Literal["big", "little"]

WORDS: dict[RegisterType, int] = {
    "int16": 1,
    "uint16": 1,
    "int32": 2,
    "uint32": 2,
    "int64": 4,
    "uint64": 4,
    "float32": 2,
    "float64": 4,
}
"""Registers that one value of a type fills; a bcd and a string say it themselves, a bool is a bit."""
SIGNED = frozenset({"int16", "int32", "int64"})
INTEGERS = SIGNED | {"uint16", "uint32", "uint64"}
"""Types whose contents are whole numbers, of which a part may be meant."""
