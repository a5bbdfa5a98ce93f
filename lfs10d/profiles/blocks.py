"""Values that neighbour each other come in one read: batching, and decoding what a read brought."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from lfs10d.profiles.registers import Cell
from lfs10d.profiles.values import ReadFunction, Value
from lfs10d.reading import Fault, FaultCode, Number


@dataclass(frozen=True, slots=True)
class Block:
    """One read: `count` registers from `address`, and the values that lie in them."""

    function: ReadFunction
    address: int
    count: int
    values: tuple[Value, ...]
    cells: tuple[Cell, ...] = field(repr=False)

    @classmethod
    def of(cls, values: tuple[Value, ...]) -> Block:
        """Span `values`, which are of one function and leave no register between them."""
        first = values[0]
        count = max(value.end for value in values) - first.register
        cells = tuple(value.cell(first.register) for value in values)
        return cls(first.function, first.register, count, values, cells)

    def decode(self, registers: tuple[int, ...]) -> dict[str, Number] | Fault:
        """Return every value by name, or the first fault: a sample is good as a whole or not at all."""
        if len(registers) != self.count:
            return Fault(FaultCode.MALFORMED, f"{len(registers)} registers came, {self.count} were asked")
        numbers: dict[str, Number] = {}
        for cell in self.cells:
            number = cell.decode(registers)
            if isinstance(number, Fault):
                return number
            numbers[cell.name] = number
        return numbers


def batch(values: Iterable[Value], most_words: int) -> tuple[Block, ...]:
    """Put values that touch or overlap into one read of at most `most_words`; read no register between.

    Each value fits `most_words` by itself. Blocks come in order of function and address.
    """
    blocks: list[Block] = []
    together: list[Value] = []
    end = 0
    for value in sorted(values, key=lambda value: (value.function, value.register, value.words)):
        if together:
            first = together[0]
            touches = value.function == first.function and value.register <= end
            if not touches or max(end, value.end) - first.register > most_words:
                blocks.append(Block.of(tuple(together)))
                together.clear()
        end = max(end, value.end) if together else value.end
        together.append(value)
    if together:
        blocks.append(Block.of(tuple(together)))
    return tuple(blocks)
