"""Polls on request: each has a number that comes back with the reading."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Iterable, Mapping
from itertools import count

from lfs10d.reading import Fault, Reading
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import Payload, Publication, PublicationKind


@dataclass(frozen=True, slots=True)
class ReadResult:
    """The published sample of one poll, and its fault if there is no value."""

    sample: Payload
    fault: Fault | None


class PendingReads:
    """The polls under way. Used in the thread of the asyncio loop; `submit(device, number)` begins one on the line."""

    def __init__(self, submit: Callable[[str, int], None]) -> None:
        self._submit = submit
        self._numbers = count(1)
        self._waiting: dict[int, tuple[str, asyncio.Future[ReadResult | None]]] = {}

    async def read(self, device: str) -> ReadResult | None:
        """Have a device polled and wait for its sample; None if `abandon` came first."""
        number = next(self._numbers)
        future: asyncio.Future[ReadResult | None] = asyncio.get_running_loop().create_future()
        self._waiting[number] = device, future
        try:
            self._submit(device, number)
            return await future
        finally:
            del self._waiting[number]

    def on_reading(self, reading: Reading, published: Iterable[Publication]) -> None:
        """Resolve the reads that wait for this reading, which led to the publications `published`."""
        sample = next((each.payload for each in published if each.kind is PublicationKind.SAMPLE), None)
        for number in reading.requests:
            self._resolve(number, ReadResult(sample, reading.fault))

    def abandon(self, devices: Collection[str]) -> None:
        """End the reads of these devices without a reading."""
        for number, (device, _) in self._waiting.items():
            if device in devices:
                self._resolve(number, None)

    def _resolve(self, number: int, result: ReadResult | None) -> None:
        if number in self._waiting:
            _, future = self._waiting[number]
            if not future.done():
                future.set_result(result)


def altered(before: Mapping[str, object], after: Mapping[str, object]) -> frozenset[str]:
    """Return the names that are gone or belong to another device than before."""
    return frozenset(name for name, what in before.items() if after.get(name) != what)
