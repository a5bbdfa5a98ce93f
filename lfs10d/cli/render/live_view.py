"""The live view of `watch` and `demo`: a table on a terminal; in a pipe a line, plain or JSON, for each new value."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Protocol

import click

from lfs10d.cli import print_lines
from lfs10d.cli.json_text import json_text
from lfs10d.cli.render.live_lines import LiveLines
from lfs10d.cli.render.live_state import LiveState
from lfs10d.cli.render.live_table import DataSource


class LiveView(Protocol):
    """Shows the state of a line between enter and exit."""

    def __enter__(self) -> object:
        """Begin."""

    def __exit__(self, *error: object) -> None:
        """End."""

    def draw(self, live: LiveState, source: DataSource, *, now: float, wall: float) -> None:
        """Show the state; `now` is monotonic s, `wall` epoch s."""


def live_view(*, as_json: bool = False, remarks: Sequence[str] = ()) -> LiveView:
    """Return the view that fits standard output; `remarks` stand below the table, or above the first line."""
    if not as_json and sys.stdout.isatty() and os.environ.get("TERM") not in {None, "dumb"}:
        from lfs10d.cli.render.live_screen import LiveScreen  # noqa: PLC0415  # imports rich: for a terminal only

        return LiveScreen(remarks)
    return LivePrinter(as_json=as_json, remarks=remarks)


class LivePrinter:
    """For a pipe: each new value is one line, plain or JSON."""

    def __init__(self, *, as_json: bool, remarks: Sequence[str] = ()) -> None:
        self._as_json = as_json
        self._remarks = remarks
        self._lines = LiveLines()

    def __enter__(self) -> None:
        """Print the remarks; JSON has none."""
        if not self._as_json:
            print_lines(f"# {remark}" for remark in self._remarks)

    def __exit__(self, *error: object) -> None:
        """Do nothing: each line was complete."""

    def draw(self, live: LiveState, source: DataSource, *, now: float, wall: float) -> None:
        """Print what is new."""
        for plain, data in self._lines.changes(live, source, now=now, wall=wall):
            if self._as_json and data is not None:
                click.echo(json_text(data))
            elif not self._as_json:
                click.echo(plain)
