"""How a sample lies in the store: numbers as cells of SQLite, and a check over each row. Pure.

A float32 is kept as its four bytes and comes back as the same shortest decimal; what is no float32 (a scaled
number) is kept whole. A page of the file that was cut or has rotted may still read as a row: the check, which
SQLite does not have, tells.
"""

from __future__ import annotations

import json
import struct
import zlib
from dataclasses import dataclass
from typing import TypeAlias, cast

from lfs10d.profiles.registers import shortest
from lfs10d.reading import Number
from lfs10d.telemetry.publication import Quality, Sample

Cell: TypeAlias = int | float | bytes | str | None
"""A number as SQLite keeps it; None where there is none."""

_FLOAT32 = struct.Struct("<f")
_BITS = struct.Struct("<I")
_INTEGERS = range(-(2**63), 2**63)
"""What SQLite keeps as an integer (https://www.sqlite.org/datatype3.html)."""
_TENTHS = 10
_CHECKS = 1 << 16


class DamagedError(Exception):
    """The store's file says what no store of ours ever said; it must be put aside."""


def pack(number: Number) -> Cell:
    """Return the smallest cell from which `unpack` makes the same number of the same type."""
    if isinstance(number, int):
        return number if number in _INTEGERS else str(number)
    try:
        four = _FLOAT32.pack(number)
    except OverflowError:
        return number
    same = shortest(_BITS.unpack(four)[0])
    return four if same == number else number


def unpack(cell: Cell) -> Number | None:
    """Return the number that was packed; raises DamagedError."""
    match cell:
        case None | int() | float():
            return cell
        case bytes() if len(cell) == _FLOAT32.size:
            return shortest(_BITS.unpack(cell)[0])
        case str() if cell.removeprefix("-").isdecimal():
            return int(cell)
        case _:
            raise DamagedError("a number that is none")


def pack_rtt(rtt_ms: float | None) -> Cell:
    """Return a round trip in tenths of a millisecond where it is given in tenths, which it is."""
    if rtt_ms is None:
        return None
    tenths = round(rtt_ms * _TENTHS)
    return tenths if tenths / _TENTHS == rtt_ms else rtt_ms


def unpack_rtt(cell: Cell) -> float | None:
    """Return the milliseconds that were packed; raises DamagedError."""
    match cell:
        case None | float():
            return cell
        case int():
            return cell / _TENTHS
        case _:
            raise DamagedError("a round trip that is none")


@dataclass(frozen=True, slots=True)
class Series:
    """What many samples have in common, as one row of its own; `repeated`: the broker has acknowledged them once."""

    boot: str
    device: str
    quality: Quality
    error: str | None
    names: tuple[str, ...]
    units: tuple[tuple[str, str], ...]
    repeated: bool

    @classmethod
    def of(cls, sample: Sample, *, repeated: bool) -> Series:
        """Return the series a sample belongs to."""
        units = tuple(sample.units.items())
        return cls(sample.boot, sample.device, sample.quality, sample.error, sample.names, units, repeated)

    @property
    def text(self) -> str:
        """JSON, from which `parse` makes the same."""
        facts = [self.boot, self.device, self.quality, self.error, self.names, self.units, self.repeated]
        return json.dumps(facts, ensure_ascii=False, separators=(",", ":"))

    @classmethod
    def parse(cls, text: str) -> Series:
        """Return the series of a text; raises DamagedError."""
        try:
            boot, device, quality, error, names, units, repeated = json.loads(text)
            pairs = tuple((str(name), str(unit)) for name, unit in units)
            series = cls(boot, device, quality, error, tuple(names), pairs, repeated)
        except (ValueError, TypeError):
            raise DamagedError("a series that is none") from None
        if series.text != text:
            raise DamagedError("a series that is none")
        return series


def check(seed: str, *facts: object) -> int:
    """Return 16 bits, signed as SQLite keeps them, over `facts` and the text they belong to."""
    return zlib.crc32(repr(facts).encode(), zlib.crc32(seed.encode())) % _CHECKS - _CHECKS // 2


def values_of(sample: Sample) -> tuple[Cell, ...]:
    """Return the cells of a sample's values in order of its names; () for a bad one."""
    if sample.values is None:
        return ()
    values = sample.values
    return tuple(pack(cast("Number", values[name])) if name in values else None for name in sample.names)


def values_from(series: Series, cells: tuple[Cell, ...]) -> dict[str, Number] | None:
    """Return a sample's values; raises DamagedError."""
    if series.quality == "bad":
        return None
    named = zip(series.names, map(unpack, cells), strict=False)
    return cast("dict[str, Number]", {name: value for name, value in named if value is not None})
