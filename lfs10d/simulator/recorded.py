"""Recorded values from a CSV file: what each simulated sensor measures when; errors have a line and column.

::

    time,wind_speed,3.wind_speed
    2026-11-21T12:00:00Z,4.2,5.1
    2026-11-21T12:00:01Z,4.6,

`time` is ISO 8601, or seconds. A column is a value's name, for every sensor that has it, or a slave id, a point and the
name, for that sensor alone. A value holds until the next row; an empty cell is a time without a value. After the last
row it begins again.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

from lfs10d.errors import ConfigError, Problem
from lfs10d.schema.fields import quoted
from lfs10d.simulator.wire import SECOND

LARGEST_FILE: Final = 64_000_000
"""Bytes: a day at 4 Hz for eight sensors has about 20 million."""
MOST_PROBLEMS: Final = 20
GREATEST: Final = 1e9
"""What a register can hold in every type; far above any measured value."""
_DELIMITERS: Final = ",;\t"
_NUMBER: Final = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?", re.ASCII)
_COLUMN: Final = re.compile(r"(?:(\d{1,3})\.)?([a-z][a-z0-9_]*)", re.ASCII)


@dataclass(frozen=True, slots=True)
class RecordedValue:
    """One column: `values[n]` holds from `times[n]` on, in ns since the start, and all repeat after `period` ns."""

    times: tuple[int, ...]
    values: tuple[float | None, ...]
    period: int

    def __call__(self, now: int) -> float | None:
        """Return the value at `now` in ns; None where the cell is empty."""
        return self.values[bisect_right(self.times, now % self.period) - 1]


@dataclass(frozen=True, slots=True)
class Recording:
    """A whole file: its columns by slave id (None: every sensor) and name of the value."""

    columns: Mapping[tuple[int | None, str], RecordedValue]

    def of_slave(self, slave: int) -> dict[str, RecordedValue]:
        """Return what is recorded for a sensor, by name of the value; its own columns go before those for all."""
        common = {name: column for (whose, name), column in self.columns.items() if whose is None}
        return common | {name: column for (whose, name), column in self.columns.items() if whose == slave}


@dataclass(frozen=True, slots=True)
class _Cell:
    """A cell without the spaces and quotes around it; `line` and `column` count from 1."""

    text: str
    line: int
    column: int

    def problem(self, file: str, message: str) -> Problem:
        return Problem(file, self.line, self.column, "", message)


def parse_recording(text: str, file: str, devices: Mapping[int, Collection[str]]) -> Recording:
    """Read a CSV file for devices with these slave ids and names of values; raises ConfigError with every problem."""
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    if not lines:
        raise ConfigError((Problem(file, 1, 1, "", "is empty; the first line names the columns: time,wind_speed"),))
    delimiter = max(_DELIMITERS, key=lines[0][1].count)
    head, *rows = (tuple(_cells(line, n, delimiter)) for n, line in lines)
    problems = list(_problems_of_head(head, file, devices))
    if not problems:
        problems += _problems_of_rows(head, rows, file)
    if problems:
        raise ConfigError(tuple(sorted(problems)[:MOST_PROBLEMS]))
    moments = [_moment(row[0].text) for row in rows]
    times = tuple(round((each - moments[0]) * SECOND) for each in moments)
    period = max(times[-1] + (times[-1] - times[-2] if len(times) > 1 else SECOND), 1)
    return Recording(
        {
            _owner(cell.text): RecordedValue(times, tuple(_number(row[n].text) for row in rows), period)
            for n, cell in enumerate(head[1:], 1)
        }
    )


def load_recording(path: Path, devices: Mapping[int, Collection[str]]) -> Recording:
    """Read a CSV file; raises ConfigError, also if it cannot be read."""
    try:
        with path.open("rb") as file:
            raw = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise ConfigError((Problem(str(path), 1, 1, "", f"cannot be read: {error.strerror}"),)) from error
    if len(raw) > LARGEST_FILE:
        message = f"the file is too large; at most {LARGEST_FILE // 1_000_000} MB are read"
        raise ConfigError((Problem(str(path), 1, 1, "", message),))
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        column = error.start - raw.rfind(b"\n", 0, error.start)
        message = f"byte 0x{raw[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise ConfigError((Problem(str(path), line, column, "", message),)) from None
    return parse_recording(text, str(path), devices)


def _cells(line: str, number: int, delimiter: str) -> Iterator[_Cell]:
    column = 1
    for part in line.split(delimiter):
        text = part.strip()
        if len(text) > 1 and text[0] == text[-1] == '"':
            text = text[1:-1].strip()
        yield _Cell(text, number, column + len(part) - len(part.lstrip()))
        column += len(part) + 1


def _owner(name: str) -> tuple[int | None, str]:
    """Return slave id and name of the value that a column is for; ValueError for a name of another form."""
    found = _COLUMN.fullmatch(name)
    if found is None:
        raise ValueError(name)
    return None if found[1] is None else int(found[1]), found[2]


def _problems_of_head(head: tuple[_Cell, ...], file: str, devices: Mapping[int, Collection[str]]) -> Iterator[Problem]:
    if head[0].text != "time":
        yield head[0].problem(file, f"the first column must be named time, not {quoted(head[0].text)}")
        return
    if len(head) == 1:
        yield head[0].problem(file, "there is no column beside time; a value is a column: time,wind_speed")
    seen: set[tuple[int | None, str]] = set()
    for cell in head[1:]:
        try:
            slave, name = owner = _owner(cell.text)
        except ValueError:
            yield cell.problem(file, f"{quoted(cell.text)} names no value; write wind_speed or 3.wind_speed")
            continue
        known = set[str]().union(*devices.values()) if slave is None else devices.get(slave, ())
        if slave is not None and slave not in devices:
            yield cell.problem(file, f"slave {slave} is not on this line; see --slaves")
        elif name not in known:
            whose = "any sensor" if slave is None else f"slave {slave}"
            yield cell.problem(file, f"{name} is no value of {whose}; known: {', '.join(sorted(known))}")
        elif owner in seen:
            yield cell.problem(file, f"{cell.text} is there twice")
        seen.add(owner)


def _problems_of_rows(head: tuple[_Cell, ...], rows: list[tuple[_Cell, ...]], file: str) -> Iterator[Problem]:
    if not rows:
        yield head[0].problem(file, "there is no row below the names of the columns")
        return
    form = _form(rows[0][0].text)
    before = -math.inf
    for row in rows:
        if len(row) != len(head):
            yield row[0].problem(file, f"the row has {len(row)} cells, the first line has {len(head)}")
            continue
        first = row[0]
        if form is None or _form(first.text) is not form:
            meant = "as in the first row" if form else "in seconds, or as 2026-11-21T12:00:00Z"
            yield first.problem(file, f"{quoted(first.text)} is no time; write it {meant}")
        else:
            moment = _moment(first.text)
            if moment <= before:
                yield first.problem(file, f"the time {quoted(first.text)} is not after that of the row before")
            before = max(moment, before)
        for cell in row[1:]:
            if not _is_number(cell.text):
                yield cell.problem(file, f"{quoted(cell.text)} is no number; write 4.2, or nothing for no value")


def _seconds(text: str) -> float:
    if _NUMBER.fullmatch(text) is None or math.isinf(float(text)):
        raise ValueError(text)
    return float(text)


def _aware(text: str) -> float:
    moment = datetime.fromisoformat(text)
    if moment.tzinfo is None:
        raise ValueError(text)
    return moment.timestamp()


def _naive(text: str) -> float:
    """Return a time without a zone as if it were UTC: only differences count."""
    return _aware(f"{text}+00:00")


_FORMS: Final = (_seconds, _aware, _naive)


def _form(text: str) -> Callable[[str], float] | None:
    """Return how a time is written, as the function that reads it; None for what is no time."""
    for form in _FORMS:
        try:
            form(text)
        except ValueError:
            continue
        return form
    return None


def _moment(text: str) -> float:
    """Return a time in seconds; it has a form."""
    form = _form(text)
    assert form is not None  # noqa: S101  # checked with the rows
    return form(text)


def _is_number(text: str) -> bool:
    """Whether a cell is a number in the range of all registers, or empty."""
    return not text or (_NUMBER.fullmatch(text) is not None and abs(float(text)) <= GREATEST)


def _number(text: str) -> float | None:
    return float(text) if text else None
