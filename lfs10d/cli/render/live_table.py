"""The live table: the state of a line as lines of styled text, for a terminal of any size. Pure.

A line is a tuple of pieces, each a text and its style in rich's words ("" is plain).
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import tzinfo
from typing import Final, TypeAlias

from lfs10d.cli.local_time import since_text, zone_name
from lfs10d.cli.render.error_words import BESIDE_GOOD, OF_THE_LINE, in_words
from lfs10d.cli.render.live_state import LiveState, ShownDevice
from lfs10d.cli.render.value_text import with_unit
from lfs10d.system.dataclass import dataclass
from lfs10d.system.logs import escape

Piece: TypeAlias = tuple[str, str]
Line: TypeAlias = tuple[Piece, ...]

LONGEST_WORD: Final = 200
"""Characters of one thing about the line: enough for the path of a port."""

JUST: Final = 5.0
"""s for which a device that came or went is marked."""

_MARKS: Final = {"moved": ">", "came": "+", "went": "-"}
_MARK_STYLES: Final = {"moved": "bold black on green", "came": "bold green", "went": "bold red"}


@dataclass(frozen=True, slots=True)
class DataSource:
    """The source of the state, in words; `alive`: it is current."""

    words: str
    alive: bool


@dataclass(frozen=True, slots=True)
class TableRow:
    """One device as it is shown. `stale`: its value is not current."""

    name: str
    slave: str
    label: str
    value: str
    state: str
    age: str
    rtt: str
    just: str
    stale: bool
    good: bool
    gust: str = ""
    mean: str = ""


@dataclass(frozen=True, slots=True)
class _Moment:
    """When it is shown: monotonic s, epoch s, and the zone of its times."""

    now: float
    wall: float
    zone: tzinfo | None


def rows(live: LiveState, source: DataSource, *, now: float, wall: float, zone: tzinfo | None = None) -> list[TableRow]:
    """Return the devices as they are to be shown, times in `zone` (None: this machine's)."""
    movers = {device.name for device in live.movers(now)} if source.alive else set()
    return [
        _row(live, device, source, _Moment(now, wall, zone), moved=device.name in movers)
        for device in live.devices.values()
    ]


def _row(live: LiveState, device: ShownDevice, source: DataSource, moment: _Moment, *, moved: bool) -> TableRow:
    stale = not source.alive or (device.good and live.late(device, moment.wall))
    just = "moved" if moved else ""
    if source.alive and device.turned is not None and moment.now - device.turned[0] < JUST:
        just = "came" if device.turned[1] else "went"
    alone = len(device.values) == 1
    values = [with_unit(name, value, device.units.get(name, ""), alone=alone) for name, value in device.values.items()]
    age = live.age(device, moment.wall) if device.enabled else None
    return TableRow(
        name=escape(device.name),
        slave="" if device.slave is None else str(device.slave),
        label=escape(device.label or ""),
        value=", ".join(values) or "-",
        state=_state(device, moment, stale=stale),
        age="" if age is None else age_text(age),
        rtt="" if device.rtt_ms is None or stale else f"{device.rtt_ms:.0f} ms",
        just=just,
        stale=stale,
        good=device.good and device.alarm not in BESIDE_GOOD,
        gust="" if device.gust is None else f"{device.gust:.2f}",
        mean="" if device.mean is None else f"{device.mean:.2f}",
    )


def _state(device: ShownDevice, moment: _Moment, *, stale: bool) -> str:
    """Return availability and error, as code and words, and since when."""
    if not device.enabled:
        return "disabled"
    if device.good and stale:
        return "old value"
    if device.good and device.alarm in BESIDE_GOOD:
        return in_words(device.alarm) + _since(device.since, moment.wall, moment.zone)
    if device.good:
        lacking = ", ".join(f"{escape(name)} {escape(code)}" for name, code in device.errors.items())
        return f"partial: {lacking}" if lacking else "good"
    if device.error is None:
        return "no reply yet"
    trouble = in_words(device.error)
    if not device.online and device.error not in OF_THE_LINE:
        trouble = f"offline: {trouble}"
    return trouble + _since(device.since, moment.wall, moment.zone)


def _since(ts: float | None, wall: float, zone: tzinfo | None) -> str:
    return "" if ts is None else f"; since {since_text(ts, wall * 1000, zone)}"


def age_text(seconds: float) -> str:
    """Return an age in at most four characters: 0.4s, 12s, 5m, 3h, 20d."""
    if seconds < 9.95:  # noqa: PLR2004 - the largest with one decimal
        return f"{seconds:.1f}s"
    for unit, length in (("s", 1), ("m", 60), ("h", 3600)):
        if seconds < 100 * length:
            return f"{seconds / length:.0f}{unit}"
    return f"{seconds / 86_400:.0f}d"


@dataclass(frozen=True, slots=True)
class _Column:
    head: str
    of: Callable[[TableRow], str]
    right: bool = False
    least: int = 0
    most: int = 40


_NAME = _Column("sensor", lambda row: row.name, least=6, most=20)
_ID = _Column("id", lambda row: row.slave, right=True, least=3)
_VALUE = _Column("value", lambda row: row.value, right=True, least=9, most=24)
_GUST = _Column("gust 10m", lambda row: row.gust, right=True)
_MEAN = _Column("mean 2m", lambda row: row.mean, right=True)
_STATE = _Column("state", lambda row: row.state, least=9, most=60)
_AGE = _Column("age", lambda row: row.age, right=True, least=4)
_RTT = _Column("answer", lambda row: row.rtt, right=True, least=6)
_LABEL = _Column("label", lambda row: row.label, most=30)

_ALL: Final = (_NAME, _ID, _VALUE, _GUST, _MEAN, _STATE, _AGE, _RTT, _LABEL)
_GIVEN_UP_FIRST: Final = (_LABEL, _RTT, _MEAN, _GUST, _AGE, _ID)
"""Columns left out on a narrow terminal, in this order."""
LEAST_LABEL: Final = 6
"""A label is not cut shorter than this."""


def table(shown: Sequence[TableRow], width: int) -> list[Line]:
    """Return head and rows for a terminal `width` columns wide; none of the lines is longer."""
    widths = _widths(shown, width)
    head: list[Piece] = [("  ", "")]
    head += [(_cell(column.head, size, right=column.right) + " ", "bold dim") for column, size in widths.items()]
    return [_cut(tuple(head), width), *(_cut(_line(row, widths), width) for row in shown)]


def _line(row: TableRow, widths: dict[_Column, int]) -> Line:
    pieces: list[Piece] = [(f"{_MARKS.get(row.just, ' ')} ", _MARK_STYLES.get(row.just, ""))]
    for column, size in widths.items():
        style = ""
        if row.stale or row.state == "disabled":
            style = "dim"
        elif column is _STATE:
            style = "green" if row.good else "bold red"
        elif row.just == "moved" and column in (_NAME, _VALUE):
            style = "bold green"
        elif column is _VALUE and row.good:
            style = "bold"
        pieces.append((_cell(column.of(row), size, right=column.right) + " ", style))
    return tuple(pieces)


def _widths(shown: Sequence[TableRow], width: int) -> dict[_Column, int]:
    """Return the columns there is room for and how wide they are; the label has what is left."""
    wanted = {
        column: min(column.most, max(column.least, len(column.head), *(len(column.of(row)) for row in shown), 0))
        for column in _ALL
        if column not in (_GUST, _MEAN, _LABEL) or any(column.of(row) for row in shown)
    }
    for column in _GIVEN_UP_FIRST:
        excess = 2 + sum(wanted.values()) + len(wanted) - width
        if excess <= 1:  # the last column needs no space behind it
            break
        if column is _LABEL and wanted.get(column, 0) - excess + 1 >= LEAST_LABEL:
            wanted[column] -= excess - 1
        else:
            wanted.pop(column, None)
    return wanted


def _cell(text: str, size: int, *, right: bool) -> str:
    cut = text if len(text) <= size else text[: size - 1] + "~"
    return cut.rjust(size) if right else cut.ljust(size)


def _cut(line: Line, width: int) -> Line:
    """Return the line without what does not fit and without spaces at its end."""
    pieces: list[Piece] = []
    for text, style in line:
        if width > 0:
            pieces.append((text[:width], style))
        width -= len(text)
    while pieces and not pieces[-1][0].strip():
        pieces.pop()
    if pieces:
        pieces[-1] = pieces[-1][0].rstrip(), pieces[-1][1]
    return tuple(pieces)


def header(
    live: LiveState, source: DataSource, width: int, *, pace: bool = True, wall: float = 0.0, zone: tzinfo | None = None
) -> list[Line]:
    """Return the line and the source; `pace`: also load and rate, which change all the time.

    `wall` (epoch s) is now: what began on another day is shown with its date.
    """
    line = live.line
    words = [f"{escape(live.name)}: {_said(line, 'port')}"]
    if "baudrate" in line:
        character = f"{_said(line, 'databits')}{_said(line, 'parity')[:1].upper()}{_said(line, 'stopbits')}"
        words.append(f"{_said(line, 'baudrate')} baud {character}")
    if line.get("activity", "polling") != "polling":
        words.append(_said(line, "activity"))
    if pace and line.get("load_pct") is not None:
        words.append(f"load {_said(line, 'load_pct')} %")
    if pace and line.get("polls_per_s") is not None:
        words.append(f"{_said(line, 'polls_per_s')} polls/s")
    lines = [(", ".join(words), "bold"), (source.words, "" if source.alive else "bold yellow")]
    if line.get("open") is False and live.line_error is None:
        lines.append(("the port is not open", "bold red"))
    if live.line_error is not None:
        trouble = escape(f"{live.line_error_code}: {live.line_error}")
        if live.line_error_code == live.line_error:
            trouble = in_words(live.line_error)
        lines.append((trouble + _since(live.line_error_since, wall, zone), "bold red"))
    return [line for text, style in lines for line in _wrapped(text, style, width)]


def _said(line: Mapping[str, object], key: str) -> str:
    return escape(str(line.get(key, "?"))[:LONGEST_WORD])


def _wrapped(text: str, style: str, width: int) -> Iterator[Line]:
    """Yield a text as lines that fit."""
    parts = textwrap.wrap(text, max(1, width), subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    for part in parts or [""]:
        yield ((part[:width], style),)


def screen(
    live: LiveState,
    source: DataSource,
    size: tuple[int, int],
    *,
    now: float,
    wall: float,
    zone: tzinfo | None = None,
    remarks: Sequence[str] = (),
) -> list[Line]:
    """Return everything for a terminal of `size` columns and lines; without room for all rows, the worst of them.

    `remarks` stand below where there is room for them and all rows.
    """
    width, height = size
    shown = rows(live, source, now=now, wall=wall, zone=zone)
    above = [*header(live, source, width, wall=wall, zone=zone), ()]
    below = [line for remark in remarks for line in _wrapped(remark, "", width)]
    legend = f"> moved just now   + came   - went   times: {zone_name(wall * 1000, zone)}   Ctrl-C ends"
    room = max(1, height - len(above) - 3)
    below = [(), *below] if below and len(shown) + len(below) < room else []
    if len(shown) > room:
        kept = sorted(sorted(range(len(shown)), key=lambda place: _rank(shown[place]))[: room - 1])
        hidden = [row for place, row in enumerate(shown) if place not in kept]
        well = sum(row.good and not row.stale for row in hidden)
        legend = f"{len(hidden)} more ({well} good): a taller window shows them   {legend}"
        shown = [shown[place] for place in kept]
    return [*above, *table(shown, width), (), _cut(((legend, "dim"),), width), *below]


def _rank(row: TableRow) -> int:
    """Return the rank of a row: first what moved, then what fails, then the rest."""
    if row.just:
        return 0
    return 2 if row.good and not row.stale else 1
