"""Batches neighbouring values into one read, and decodes its registers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field

from lfs10d.profiles.cells import Cell
from lfs10d.profiles.contents import BIT_FUNCTIONS
from lfs10d.profiles.values import ReadFunction, Value
from lfs10d.reading import Fault, FaultCode
from lfs10d.reading import Value as Published
from lfs10d.system.dataclass import dataclass

MOST_BITS = 2000
"""Bits of one read (Modbus Application Protocol V1.1b3, sections 6.1 and 6.2)."""


NO_VALUE_NOW = (FaultCode.UNAVAILABLE, FaultCode.NOT_FINITE)
"""Faults of single values that do not mean that it is another device."""


@dataclass(frozen=True, slots=True)
class Block:
    """One read: `count` registers (or bits) from `address`, and the values that lie in them.

    `answer` is how many registers its answer brings; bits come in whole bytes.
    """

    function: ReadFunction
    address: int
    count: int
    values: tuple[Value, ...]
    cells: tuple[Cell, ...] = field(repr=False)
    answer: int = field(repr=False)

    @classmethod
    def of(cls, values: tuple[Value, ...]) -> Block:
        """Return the read that spans `values`, which have one function and begin with the lowest."""
        first = values[0]
        count = max(value.end for value in values) - first.register
        cells = tuple(value.cell(first.register) for value in values)
        answer = -(-count // 8) * 8 if first.function in BIT_FUNCTIONS else count
        return cls(first.function, first.register, count, values, cells, answer)

    def take(
        self, registers: tuple[int, ...], values: dict[str, Published | None], faults: dict[str, Fault]
    ) -> Fault | None:
        """Put every value into `values` by name; a missing one is None, with its fault in `faults`.

        Return a fault, and take nothing, where the answer has another length than asked for.
        """
        if len(registers) != self.answer:
            return Fault(FaultCode.MALFORMED, f"{len(registers)} registers came, {self.answer} were requested")
        for cell in self.cells:
            value = cell.decode(registers)
            if isinstance(value, Fault):
                values[cell.name] = None
                faults[cell.name] = value
            else:
                values[cell.name] = value
        return None

    def decode(self, registers: tuple[int, ...]) -> dict[str, Published] | Fault:
        """Return the available values by name, or the first fault that shows another device.

        So a device is recognised. Of several values some may be unavailable, or not finite as a direction in calm often
        is. Where there is no value at all, and none that shows another device, the first fault is returned.
        """
        values: dict[str, Published | None] = {}
        faults: dict[str, Fault] = {}
        fault = self.take(registers, values, faults)
        if fault is not None:
            return fault
        there = {name: value for name, value in values.items() if value is not None}
        wrong = [fault for fault in faults.values() if fault.code not in NO_VALUE_NOW]
        if not there:
            wrong += faults.values()
        return wrong[0] if wrong else there


def batch(
    values: Iterable[Value], most_words: int, may_skip: int = 0, named: Iterable[Value] = ()
) -> tuple[Block, ...]:
    """Batch values that touch or overlap into reads of at most `most_words`.

    At most `may_skip` registers between two values are read that no value names: none of these, and none of `named`,
    the others of the device, which it may lack. Each value fits `most_words` by itself. Values of one read have one
    interval. Blocks come in order of function and address.
    """
    values = tuple(values)
    others = (*values, *named)
    blocks: list[Block] = []
    together: list[Value] = []
    end = 0
    for value in sorted(values, key=_order):
        if together:
            first = together[0]
            touches = _alike(value, first) and value.register <= end + may_skip
            touches = touches and not _names_one(others, value.function, end, value.register)
            most = MOST_BITS if value.function in BIT_FUNCTIONS else most_words
            if not touches or max(end, value.end) - first.register > most:
                blocks.append(Block.of(tuple(together)))
                together.clear()
        end = max(end, value.end) if together else value.end
        together.append(value)
    if together:
        blocks.append(Block.of(tuple(together)))
    return tuple(blocks)


def _order(value: Value) -> tuple[float, ...]:
    return value.function, value.interval or 0, value.register, value.words


def _names_one(values: Iterable[Value], function: ReadFunction, first: int, end: int) -> bool:
    """Whether one of the values has a register from `first` up to `end`, which is excluded."""
    return first < end and any(
        value.function == function and value.register < end and first < value.end for value in values
    )


def _alike(value: Value, other: Value) -> bool:
    return (value.function, value.interval) == (other.function, other.interval)
