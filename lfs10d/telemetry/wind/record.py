"""Records: the wind of each whole span of UTC, such as 10 min, as one sample with a number of its own. Pure.

A span is [from, to) on the wall clock. What was measured is in exactly one record: a record begins where the one before
ended, as the wall clock sees it now. So when the clock is set, what is not in a record yet belongs to the spans that
the new time gives it, which may have been recorded under the old time already: `seq` tells them apart.
"""

from __future__ import annotations

from typing import ClassVar, Final

from lfs10d.reading import Value
from lfs10d.system.dataclass import dataclass
from lfs10d.telemetry.publication import HISTORY, RECORD, Sample, device_of

EVEN_WITHIN: Final = 1000
"""Milliseconds by which a clock that is slewed may be away from where the record before ended."""

_SUFFIX: Final = f"/{RECORD}"
"""Ends the source of records: no name of a device has a slash."""


@dataclass(frozen=True, slots=True)
class Span:
    """The span of one record: [begin, end) in ms of the clock that never goes back, `to` in epoch ms."""

    begin: int
    end: int
    to: int


class RecordSpans:
    """Spans of `length` ms one after the other, the first of which begins at `begin`."""

    def __init__(self, length: int, begin: int) -> None:
        self.length = length
        self.begin = begin
        """When the span that runs began, as far as it is not recorded."""

    def due(self, shift: int) -> int:
        """Return when the span that runs is over; `shift` is the wall clock less the other, in ms."""
        return self._next(shift).end

    def take(self, now: int, shift: int) -> Span | None:
        """Return the span that is over, None where none is; the next one begins."""
        span = self._next(shift)
        if now < span.end:
            return None
        self.begin = span.end
        return span

    def _next(self, shift: int) -> Span:
        number = (self.begin + shift + EVEN_WITHIN) // self.length
        to = (number + 1) * self.length
        return Span(self.begin, to - shift, to)


@dataclass(frozen=True, slots=True)
class WindRecord(Sample):
    """One record. `ts` is its end; `values` are figures of `record_figures`, their times in ms before that."""

    late_leaf: ClassVar = RECORD
    grouped: ClassVar = False
    """Each record is a message."""

    @property
    def source(self) -> str:
        """The records of its device."""
        return f"{self.device}{_SUFFIX}"

    def payload(self, line: str, *, historical: bool = False) -> dict[str, object]:
        """Return the JSON object; figures that are not among the values are null."""
        values = self.values or {}
        payload = self.header(line)
        payload["unit"] = self.units.get("mean")
        payload["from"] = self._before(values["length"])
        payload["to"] = self.ts
        for name in self.names:
            if name.endswith("_before"):
                payload[f"{name.removesuffix('_before')}_ts"] = self._before(values.get(name))
            elif name != "length":
                payload[name] = values.get(name)
        if historical:
            payload["historical"] = True
        return payload

    def _before(self, milliseconds: Value | None) -> int | None:
        return self.ts - milliseconds if isinstance(milliseconds, int) else None


RECORD_NAMES: Final = (
    "length", "mean", "gust", "gust_before", "lull", "lull_before", "max", "stddev", "samples", "coverage",
)  # fmt: skip
DIRECTION_NAMES: Final = ("direction", "direction_stddev")
"""Names of the values of a record, the second ones with a vane."""


def is_record(source: str) -> bool:
    """Return whether records have this source."""
    return source.endswith(_SUFFIX)


def device_of_source(source: str) -> str:
    """Return the device whose samples or records have this source."""
    return source.removesuffix(_SUFFIX)


def source_of(topic: str) -> str | None:
    """Return the source whose samples go to this topic when they are no longer live, None where none do."""
    device = device_of(topic, RECORD)
    return device_of(topic, HISTORY) if device is None else f"{device}{_SUFFIX}"
