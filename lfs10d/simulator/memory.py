"""The registers and bits of a simulated device: measured when they are read, written where that is allowed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import count as count_from
from typing import Final, TypeAlias

from lfs10d.simulator.blueprint import (
    READ_INPUT,
    WRITE_COILS,
    WRITE_SEVERAL,
    WRITE_SINGLE,
    Blueprint,
)
from lfs10d.simulator.faults import ActiveFaults, FaultKind, SensorFault
from lfs10d.simulator.frame_faults import broken_float
from lfs10d.simulator.recorded import RecordedValue
from lfs10d.simulator.signals import READ_HOLDING, Published, Signal
from lfs10d.simulator.wind import WindSource
from lfs10d.simulator.wire import Framing

EXCEPTION_BIT: Final = 0x80
ILLEGAL_FUNCTION: Final = 1
ILLEGAL_ADDRESS: Final = 2
ILLEGAL_VALUE: Final = 3
READS: Final = frozenset({1, 2, READ_HOLDING, READ_INPUT})
REQUEST_BODY: Final = 6
"""Bytes of the requests 01 to 04 and 06 without their check: id, function, two words; 15 and 16 have more."""
_MOST_BITS: Final = 2000
_COUNT_AT: Final = 6

Measured: TypeAlias = tuple[tuple[str, Published | None], ...]
"""The values in an answer by name; None where it is a broken one."""


def numbers(measured: Measured) -> tuple[float, ...]:
    """Return the numbers among what was measured."""
    return tuple(value for _, value in measured if isinstance(value, int | float) and not isinstance(value, bool))


def refusal(body: bytes, code: int) -> bytes:
    """Return the exception answer to a request."""
    return bytes((body[0], body[1] | EXCEPTION_BIT, code))


def is_whole(body: bytes) -> bool:
    """Whether a request has the length that its function has."""
    if body[1] in (WRITE_COILS, WRITE_SEVERAL):
        return len(body) > _COUNT_AT and len(body) == _COUNT_AT + 1 + body[_COUNT_AT]
    return len(body) == REQUEST_BODY


class Memory:
    """What one device holds. `words` are its registers by address, `inputs` those that only function 4 reads.

    `recorded` has the values, by name, that do not come from the sensor's source.
    """

    def __init__(self, blueprint: Blueprint, recorded: Mapping[str, RecordedValue] | None = None) -> None:
        self.blueprint = blueprint
        self.recorded: Mapping[str, RecordedValue] = recorded or {}
        self.words = dict(blueprint.words)
        self.inputs: dict[int, int] = {}
        self.bits: dict[tuple[int, int], int] = {}
        self._last: dict[Signal, float] = {}
        own = ((signal.function, signal.address, signal.count) for signal in blueprint.signals)
        for function, address, count in (*own, *blueprint.spans):
            for place in range(address, address + count):
                if function in (READ_HOLDING, READ_INPUT):
                    self._space(function).setdefault(place, 0)
                else:
                    self.bits[function, place] = 0

    def _space(self, function: int) -> dict[int, int]:
        return self.inputs if function == READ_INPUT else self.words

    def read(
        self, body: bytes, framing: Framing, source: WindSource, now: int, active: ActiveFaults
    ) -> tuple[bytes, Measured]:
        """Return the answer to a read, and what was measured for it."""
        function = body[1]
        address, count = int.from_bytes(body[2:4], "big"), int.from_bytes(body[4:6], "big")
        bits = function not in (READ_HOLDING, READ_INPUT)
        most = _MOST_BITS if bits else self.blueprint.most_words(framing)
        if not 1 <= count <= most:
            return refusal(body, ILLEGAL_VALUE), ()
        measured: list[tuple[Signal, Published | None]] = []
        empty: list[Signal] = []
        for signal in self.blueprint.signals:
            overlaps = signal.address < address + count and address < signal.address + signal.count
            if overlaps and self._answers(signal, function):
                if _strikes(active, FaultKind.ABSENT, signal):
                    return refusal(body, ILLEGAL_ADDRESS), ()
                value = self._value(signal, source, now, active)
                silent = value is None or _strikes(active, FaultKind.UNAVAILABLE, signal)
                if silent and not signal.is_bit:  # a bit cannot say that there is no value, and stays as it is
                    empty.append(signal)
                    value = None
                measured.append((signal, None if value is None else self._hold(signal, value, active)))
        emptied = self._emptied(empty)
        try:
            if bits:
                data = _packed([self.bits[function, place] for place in range(address, address + count)])
            else:
                words = {**self.words, **self.inputs} if function == READ_INPUT and self.inputs else self.words
                words = {**words, **emptied} if emptied else words
                data = b"".join([words[place].to_bytes(2, "big") for place in range(address, address + count)])
        except KeyError:
            return refusal(body, ILLEGAL_ADDRESS), ()
        told = ((signal.name, None if self._hidden(signal, emptied) else value) for signal, value in measured)
        return body[:2] + bytes((len(data),)) + data, tuple(told)

    def _answers(self, signal: Signal, function: int) -> bool:
        """Whether a read by this function brings this signal.

        Holding registers are read by function 4 too, where the device has no input registers.
        """
        holding = signal.function == READ_HOLDING and function == READ_INPUT and signal.address not in self.inputs
        return signal.function == function or holding

    def _value(self, signal: Signal, source: WindSource, now: int, active: ActiveFaults) -> float | None:
        """Return what the signal measures now, None where nothing was recorded."""
        last = self._last.get(signal)
        if last is not None and _strikes(active, FaultKind.STUCK, signal):
            value = last
        elif (recorded := self.recorded.get(signal.name)) is None:
            value = signal.fitted(source(now))
        elif (known := recorded(now)) is not None:
            value = known
        else:
            return None
        self._last[signal] = value
        return value

    def _hold(self, signal: Signal, value: float, active: ActiveFaults) -> Published | None:
        """Put the value into the signal's registers; return what they say, None if it is a broken one."""
        if signal.is_bit:
            self.bits[signal.function, signal.address] = signal.bit(value)
            return signal.settled(value)
        broken = broken_float(active, signal.name)
        words = signal.words(value) if broken is None else signal.broken(broken)
        space = self._space(signal.function)
        for place, word, mask in zip(count_from(signal.address), words, signal.masks, strict=False):
            space[place] = space[place] & ~mask | word & mask
        return None if broken is not None else signal.settled(value)

    def _emptied(self, signals: Iterable[Signal]) -> Mapping[int, int]:
        """Return the registers of these signals, all of one function, as they say that there is no value."""
        emptied: dict[int, int] = {}
        for signal in signals:
            space = self._space(signal.function)
            for place, word, mask in zip(count_from(signal.address), signal.empty(), signal.empty_masks, strict=False):
                emptied[place] = emptied.get(place, space[place]) & ~mask | word & mask
        return emptied

    def _hidden(self, signal: Signal, emptied: Mapping[int, int]) -> bool:
        """Whether registers that say of another part that it has no value do not say this signal's."""
        if not emptied or signal.is_bit:
            return False
        space = self._space(signal.function)
        return any(
            (emptied.get(place, space[place]) ^ space[place]) & mask
            for place, mask in zip(count_from(signal.address), signal.masks, strict=False)
        )

    def refuses(self, body: bytes) -> int | None:
        """Return the exception to a write that is not allowed; None for one that is."""
        if body[1] == WRITE_COILS:
            address, count = int.from_bytes(body[2:4], "big"), int.from_bytes(body[4:6], "big")
            coils = all(place in self.blueprint.coils for place in range(address, address + count))
            return None if coils else ILLEGAL_ADDRESS
        for address, value in written(body).items():
            allowed = self.blueprint.writable.get(address)
            if allowed is None:
                return ILLEGAL_ADDRESS
            if value not in allowed:
                return ILLEGAL_VALUE
        return None

    def write_coils(self, body: bytes) -> None:
        """Take the coils that a request of function 15 writes."""
        address, count = int.from_bytes(body[2:4], "big"), int.from_bytes(body[4:6], "big")
        data = body[_COUNT_AT + 1 :]
        for n in range(count):
            self.bits[1, address + n] = data[n // 8] >> n % 8 & 1


def written(body: bytes) -> Mapping[int, int]:
    """Return the registers that a request of function 6 or 16 writes, and what."""
    address = int.from_bytes(body[2:4], "big")
    if body[1] == WRITE_SINGLE:
        return {address: int.from_bytes(body[4:6], "big")}
    data = body[_COUNT_AT + 1 :]
    return {address + n: int.from_bytes(data[2 * n : 2 * n + 2], "big") for n in range(len(data) // 2)}


def _strikes(active: ActiveFaults, kind: FaultKind, signal: Signal) -> bool:
    fault: SensorFault | None = active.get(kind)
    return fault is not None and (not fault.values or signal.name in fault.values)


def _packed(bits: list[int]) -> bytes:
    """Return bits as bytes, the first one lowest in the first."""
    data = bytearray(-(-len(bits) // 8))
    for n, bit in enumerate(bits):
        data[n // 8] |= bit << n % 8
    return bytes(data)
