"""Recorded values from a CSV file: what each simulated sensor measures when; errors have a line and column.

::

    time,wind_speed,3.wind_speed
    2026-11-21T12:00:00Z,4.2,5.1
    2026-11-21T12:00:01Z,4.6,

`time` is ISO 8601, or seconds. A column is a value's name, for every sensor that has it, or a slave id, a point and the
name, for that sensor alone. A value holds until the next row; an empty cell is a time without a value. After the last
row it begins again. A file of 64 MB takes some 200 MB while it is read.
"""

from __future__ import annotations

import math
import re
from array import array
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import field
from datetime import datetime
from pathlib import Path
from typing import Final

from lfs10d.errors import ConfigError, Problem
from lfs10d.schema.document import text_of
from lfs10d.schema.fields import quoted
from lfs10d.simulator.wire import SECOND
from lfs10d.system.dataclass import dataclass

LARGEST_FILE: Final = 64_000_000
"""Bytes: a day at 4 Hz for eight sensors has about 20 million."""
MOST_PROBLEMS: Final = 20
GREATEST: Final = 1e9
"""What a register can hold in every type; far above any measured value."""
LATEST: Final = 1e11
"""Seconds: the greatest plain number that is a time. Milliseconds since 1970 are greater."""
LONGEST: Final = 100 * 366 * 86_400
"""Seconds from the first row to the last at most."""
_DELIMITERS: Final = ",;\t"
_NUMBER: Final = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?", re.ASCII)
_LINE: Final = re.compile(r"([^\r\n]*)(?:\r\n|\r|\n|\Z)")
_COLUMN: Final = re.compile(r"(?:(\d{1,3})\.)?([a-z][a-z0-9_]*)", re.ASCII)


@dataclass(frozen=True, slots=True)
class RecordedValue:
    """One column: `values[n]` holds from `times[n]` on, in ns since the start, and all repeat after `period` ns.

    NaN is a time without a value.
    """

    times: Sequence[int]
    values: Sequence[float]
    period: int

    def __call__(self, now: int) -> float | None:
        """Return the value at `now` in ns; None where the cell is empty."""
        value = self.values[bisect_right(self.times, now % self.period) - 1]
        return None if math.isnan(value) else value


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
    lines = _lines(text)
    number, first = next(lines, (1, ""))
    if not first:
        raise ConfigError((Problem(file, 1, 1, "", "is empty; the first line names the columns: time,wind_speed"),))
    delimiter = max(_DELIMITERS, key=first.count)
    head = tuple(_cells(first, number, delimiter))
    problems = list(_problems_of_head(head, file, devices))
    rows = _Rows(head, file, delimiter)
    if not problems:
        problems = rows.read(lines)
    if problems:
        raise ConfigError(tuple(sorted(problems)[:MOST_PROBLEMS]))
    times = rows.times
    period = max(times[-1] + (times[-1] - times[-2] if len(times) > 1 else SECOND), 1)
    return Recording(
        {
            _owner(cell.text): RecordedValue(times, column, period)
            for cell, column in zip(head[1:], rows.columns, strict=True)
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
    text = text_of(raw, str(path))
    del raw
    return parse_recording(text, str(path), devices)


@dataclass(slots=True)
class _Rows:
    """The rows below the head, as they are read: numbers only, since there may be millions."""

    head: tuple[_Cell, ...]
    file: str
    delimiter: str
    times: array[int] = field(default_factory=lambda: array("q"))
    columns: list[array[float]] = field(init=False)
    _form: Callable[[str], float] | None = None
    _start: float = 0.0
    _before: float = -math.inf

    def __post_init__(self) -> None:
        self.columns = [array("d") for _ in self.head[1:]]

    def read(self, lines: Iterator[tuple[int, str]]) -> list[Problem]:
        """Read all rows; return what is wrong with the first of those that are wrong."""
        problems: list[Problem] = []
        anything = False
        for number, line in lines:
            if not anything:
                anything, self._form = True, _form(_bare(line.split(self.delimiter, 1)[0]))
            try:
                self._keep(line.split(self.delimiter))
            except ValueError:
                problems += self._problems(tuple(_cells(line, number, self.delimiter)))
            if len(problems) >= MOST_PROBLEMS:
                break
        if not anything:
            problems.append(self.head[0].problem(self.file, "there is no row below the names of the columns"))
        return problems

    def _keep(self, parts: list[str]) -> None:
        """Keep one row; ValueError for one that has a problem."""
        if len(parts) != len(self.head) or self._form is None:
            raise ValueError
        moment = self._form(_bare(parts[0]))
        if not self.times:
            self._start = moment
        values = [_number(_bare(part)) for part in parts[1:]]
        if moment <= self._before or moment - self._start > LONGEST:
            raise ValueError
        self._before = moment
        self.times.append(round((moment - self._start) * SECOND))
        for column, value in zip(self.columns, values, strict=True):
            column.append(value)

    def _problems(self, row: tuple[_Cell, ...]) -> Iterator[Problem]:
        if len(row) != len(self.head):
            yield row[0].problem(self.file, f"the row has {len(row)} cells, the first line has {len(self.head)}")
            return
        first, form = row[0], self._form
        if form is None or _form(first.text) is not form:
            meant = "as in the first row" if form else "in seconds, or as 2026-11-21T12:00:00Z"
            yield first.problem(self.file, f"{quoted(first.text)} is no time; write it {meant}")
        else:
            moment = form(first.text)
            if moment <= self._before:
                yield first.problem(self.file, f"the time {quoted(first.text)} is not after that of the row before")
            elif self.times and moment - self._start > LONGEST:
                yield first.problem(self.file, f"the time {quoted(first.text)} is over 100 years after the first")
            self._before = max(moment, self._before)
        for cell in row[1:]:
            try:
                _number(cell.text)
            except ValueError:
                message = f"{quoted(cell.text)} is no number; write 4.2, or nothing for no value"
                yield cell.problem(self.file, message)


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield each line with its number as an editor counts; neither comments nor blank ones."""
    for number, found in enumerate(_LINE.finditer(text), 1):
        line = found[1]
        if line and not line.isspace() and not line.startswith("#"):
            yield number, line


def _bare(part: str) -> str:
    """Return a cell's text without the spaces and quotes around it."""
    text = part.strip()
    if len(text) > 1 and text[0] == text[-1] == '"':
        text = text[1:-1].strip()
    return text


def _cells(line: str, number: int, delimiter: str) -> Iterator[_Cell]:
    column = 1
    for part in line.split(delimiter):
        yield _Cell(_bare(part), number, column + len(part) - len(part.lstrip()))
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


def _seconds(text: str) -> float:
    if _NUMBER.fullmatch(text) is None or abs(float(text)) > LATEST:
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


def _number(text: str) -> float:
    """Return a cell's number, NaN where it is empty; ValueError for another text, or beyond what registers hold."""
    if not text:
        return math.nan
    if _NUMBER.fullmatch(text) is None or abs(value := float(text)) > GREATEST:
        raise ValueError(text)
    return value
