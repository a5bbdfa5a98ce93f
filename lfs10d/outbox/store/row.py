"""The format of a sample in the store: values as cells of SQLite, and a checksum over each row. Pure.

====================  ==================================================================================
a value               its cell
====================  ==================================================================================
integer               an integer; beyond 64 bits its decimal digits
float                 the four bytes of the float32 that has this shortest decimal; else the float whole
true, false           one byte, 0 or 1
text                  JSON text: in quotes
one with an age       JSON text: `[age in ms, value]`
none                  one byte that says why: `_ERRORS`
====================  ==================================================================================

A page of the file that was cut or has rotted may still read as a row: the check, which SQLite does not have, tells.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

from lfs10d.profiles.decimals import shortest
from lfs10d.reading import NOTHING, FaultCode, Value
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import Quality, Sample

Cell: TypeAlias = int | float | bytes | str | None
"""A value as SQLite keeps it; None where there is none."""

_FLOAT32 = struct.Struct("<f")
_BITS = struct.Struct("<I")
_INTEGERS = range(-(2**63), 2**63)
"""What SQLite keeps as an integer (https://www.sqlite.org/datatype3.html)."""
_BOOLEANS = {False: b"\0", True: b"\1"}
_ERRORS = {
    FaultCode.UNAVAILABLE: b"\2",
    FaultCode.NOT_FINITE: b"\3",
    FaultCode.OUT_OF_RANGE: b"\4",
    FaultCode.EXCEPTION: b"\5",
}
"""Why one value among others is not there."""
_MEANT: Mapping[bytes, tuple[bool | None, FaultCode | None, None]] = {
    **{cell: (value, None, None) for value, cell in _BOOLEANS.items()},
    **{cell: (None, error, None) for error, cell in _ERRORS.items()},
}
_NO_VALUE = "a value that is none"
_TENTHS = 10
_CHECKS = 1 << 16


class DamagedError(Exception):
    """The store's file holds what this program never wrote; it must be put aside."""


def pack(value: Value) -> Cell:
    """Return the smallest cell from which `unpack` makes the same value of the same type."""
    if isinstance(value, bool):
        return _BOOLEANS[value]
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, int):
        return value if value in _INTEGERS else str(value)
    try:
        four = _FLOAT32.pack(value)
    except OverflowError:
        return value
    same = shortest(_BITS.unpack(four)[0])
    return four if same == value else value


def pack_aged(value: Value, age: float) -> Cell:
    """Return the cell of a value and its age, which is given in s and kept in ms."""
    return json.dumps([round(age * 1000), value], separators=(",", ":"))


def unpack(cell: Cell) -> tuple[Value | None, FaultCode | None, float | None]:
    """Return what was packed: a value, or why there is none, and its age if it has one; raises DamagedError."""
    match cell:
        case None | int() | float():
            return cell, None, None
        case bytes() if len(cell) == _FLOAT32.size:
            return shortest(_BITS.unpack(cell)[0]), None, None
        case bytes() if cell in _MEANT:
            return _MEANT[cell]
        case str():
            return _unpack_text(cell)
        case _:
            raise DamagedError(_NO_VALUE)


def _refuse(word: str) -> None:
    raise ValueError(word)  # NaN and the infinities are no JSON


def _unpack_text(cell: str) -> tuple[Value, None, float | None]:
    """Return what JSON says: a text, a large integer, or an age with a value."""
    try:
        match json.loads(cell, parse_constant=_refuse):
            case str() | int() as value if pack(value) == cell:
                return value, None, None
            case [int(age), str() | int() | float() as value] if pack_aged(value, age / 1000) == cell:
                return value, None, age / 1000
    except (ValueError, OverflowError, RecursionError):
        pass
    raise DamagedError(_NO_VALUE)


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
    source: str
    quality: Quality
    error: str | None
    names: tuple[str, ...]
    units: tuple[tuple[str, str], ...]
    repeated: bool

    @classmethod
    def of(cls, sample: Sample, *, repeated: bool) -> Series:
        """Return the series a sample belongs to."""
        units = tuple(sample.units.items())
        return cls(sample.boot, sample.source, sample.quality, sample.error, sample.names, units, repeated)

    @property
    def text(self) -> str:
        """JSON, from which `parse` makes the same."""
        facts = [self.boot, self.source, self.quality, self.error, self.names, self.units, self.repeated]
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
    values, errors, ages = sample.values, sample.errors, sample.ages
    cells: list[Cell] = []
    for name in sample.names:
        value = values.get(name)
        if value is None:
            error = errors.get(name)
            cells.append(None if error is None else _ERRORS[error])
        else:
            cells.append(pack_aged(value, ages[name]) if name in ages else pack(value))
    return tuple(cells)


class Content(NamedTuple):
    """What a sample says of its values, as in `Sample`."""

    values: Mapping[str, Value | None] | None
    errors: Mapping[str, FaultCode]
    ages: Mapping[str, float]


_EMPTY = Content(None, NOTHING, NOTHING)


def content_of(series: Series, cells: tuple[Cell, ...]) -> Content:
    """Return what the cells of a sample say; raises DamagedError."""
    if series.quality == "bad":
        return _EMPTY
    values: dict[str, Value | None] = {}
    errors: dict[str, FaultCode] = {}
    ages: dict[str, float] = {}
    for name, cell in zip(series.names, cells, strict=False):
        value, error, age = unpack(cell)
        if error is not None:
            errors[name] = error
        elif value is None:
            continue
        if age is not None:
            ages[name] = age
        values[name] = value
    return Content(values, errors or NOTHING, ages or NOTHING)


def beyond_first_schema(cells: tuple[Cell, ...]) -> bool:
    """Return whether a cell is of a kind that files of schema 1 do not have: anything but a number without an age."""
    return any(
        cell in _MEANT if isinstance(cell, bytes) else isinstance(cell, str) and not cell.lstrip("-").isdecimal()
        for cell in cells
    )
