"""Tables: plain for pipes, logs and small terminals, or drawn."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator, Sequence
from typing import TypeAlias

import click

from lfs10d.system.dataclass import dataclass

Row: TypeAlias = tuple[str, ...]

REMARK = "remark"
"""The head of a column that is drawn as a warning."""


@dataclass(frozen=True, slots=True)
class Table:
    """A titled table of text, its columns in `right` to the right.

    `heads` is empty where the first column names the row.
    """

    title: str
    heads: Row
    rows: tuple[Row, ...]
    right: Collection[int] = ()


def columns(head: Sequence[str], rows: Sequence[Sequence[str]], *, right: Collection[int] = ()) -> Iterator[str]:
    """Yield a head and rows of text as lines with aligned columns, those in `right` to the right."""
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    for row in (head, *rows):
        cells = (
            cell.rjust(width) if index in right else cell.ljust(width)
            for index, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        yield "  ".join(cells).rstrip()


def show(tables: Sequence[Table]) -> None:
    """Print tables, drawn on a terminal."""
    if sys.stdout.isatty():
        _draw(tables)
    else:
        click.echo("\n\n".join("\n".join(_lines(table)) for table in tables))


def _lines(table: Table) -> Iterator[str]:
    if table.title:
        yield table.title
    heads, *rows = (table.heads, *table.rows) if table.heads else table.rows
    indent = "  " if table.title else ""
    for line in columns(heads, rows, right=table.right):
        yield indent + line


def _draw(tables: Sequence[Table]) -> None:
    # Only a terminal needs rich; importing it takes longer than the rest of the verb.
    from rich import box  # noqa: PLC0415 - for a terminal only
    from rich.console import Console  # noqa: PLC0415 - for a terminal only
    from rich.table import Table as Drawing  # noqa: PLC0415 - for a terminal only
    from rich.text import Text  # noqa: PLC0415 - for a terminal only

    console = Console()
    for number, table in enumerate(tables):
        if number:
            console.print()
        drawing = Drawing(
            title=Text(table.title, style="bold") if table.title else None,
            title_justify="left",
            box=box.SIMPLE_HEAD if table.heads else None,
            pad_edge=False,
            show_header=bool(table.heads),
        )
        for index, head in enumerate(table.heads or ("", "")):
            drawing.add_column(
                head,
                justify="right" if index in table.right else "left",
                no_wrap=not index or index in table.right or head.startswith("register"),
                style="yellow" if head == REMARK else "" if index else "cyan",
            )
        for row in table.rows:
            drawing.add_row(*(Text(cell) for cell in row))
        console.print(drawing)
