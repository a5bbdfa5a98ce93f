"""The progress of a scan on standard error: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

import click

from lfs10d.cli.render import scan_findings

if TYPE_CHECKING:  # rich is imported where something is drawn, and nowhere else
    from rich.progress import Progress as Bar

    from lfs10d.line.jobs.scan import Scan

REPORT_EVERY = 10.0
"""Percent between two lines where no bar can be drawn."""


class ProgressView(Protocol):
    """Shows how far a scan is."""

    def found(self, sentence: str) -> None:
        """Show what was found."""

    def progress(self, percent: float, remaining: float, where: str) -> None:
        """Show how far it is: percent, s to go, and where it asks now."""


@contextmanager
def progress_view(*, quiet: bool, title: str, remaining: str) -> Iterator[ProgressView]:
    """Give what shows the progress; `quiet`: only on a terminal, where it leaves nothing behind.

    `title` and `remaining` stand there until there is progress.
    """
    if not sys.stderr.isatty():
        yield _ProgressLines(quiet=quiet)
        return
    with _progress_bar() as bar:
        yield _ProgressBar(bar, title, remaining)


def span(seconds: float) -> str:
    """Return a duration as people say it: `4 s`, `1 min 5 s`."""
    whole = max(1, round(seconds))
    minutes, rest = divmod(whole, 60)
    if not minutes:
        return f"{whole} s"
    return f"{minutes} min {rest} s" if rest else f"{minutes} min"


class _ProgressLines:
    def __init__(self, *, quiet: bool) -> None:
        self._quiet = quiet
        self._next = REPORT_EVERY

    def found(self, sentence: str) -> None:
        """Print a line."""
        if not self._quiet:
            click.echo(sentence, err=True)

    def progress(self, percent: float, remaining: float, where: str) -> None:
        """Print a line now and then."""
        del where
        if not self._quiet and self._next <= percent < 100.0:  # noqa: PLR2004  # of a hundred percent
            self._next = percent + REPORT_EVERY
            click.echo(f"{percent:.0f} %, about {span(remaining)} to go", err=True)


class _ProgressBar:
    def __init__(self, bar: Bar, title: str, remaining: str) -> None:
        self._bar = bar
        self._task = bar.add_task(title, total=100.0, remaining=remaining)
        bar.refresh()

    def found(self, sentence: str) -> None:
        """Put a line above the bar."""
        self._bar.console.print(sentence, markup=False, highlight=False)

    def progress(self, percent: float, remaining: float, where: str) -> None:
        """Move the bar."""
        self._bar.update(self._task, completed=percent, description=where, remaining=span(remaining), refresh=True)


def _progress_bar() -> Bar:
    # Only a terminal needs rich; importing it takes longer than the rest of the verb.
    from rich.console import Console  # noqa: PLC0415 - for a terminal only
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn  # noqa: PLC0415 - for a terminal only

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=None),
        TaskProgressColumn(),
        TextColumn("{task.fields[remaining]} to go"),
        console=Console(stderr=True),
        auto_refresh=False,
        transient=True,
        expand=True,
    )


# A scan of our own


@contextmanager
def scan_view(scan: Scan, port: str, *, quiet: bool) -> Iterator[Callable[[], None]]:
    """Say what is about to happen and how long it takes, then give what shows all that is new; `quiet` as above."""
    plan, reported = scan.plan, set[tuple[int, int]]()

    def update() -> None:
        for finding in scan.found:
            place = finding.slave, finding.baudrate
            if place not in reported:
                reported.add(place)
                what = scan_findings.what(finding)
                shown.found(f"found {finding.slave} at {finding.baudrate} baud: {what}")
        progress = scan.progress
        where = f"{progress.baudrate} baud, id {progress.slave:>3}"
        shown.progress(progress.percent, progress.remaining, where)

    if not quiet or sys.stderr.isatty():
        rates = " and ".join(str(timing.baudrate) for timing in plan.timings)
        ids = f"id {plan.ids[0]}" if len(plan.ids) == 1 else f"{len(plan.ids)} ids"
        what = f"{ids} at {rates} baud, about {span(plan.expected)}"
        click.echo(f"Scanning {port}: {what}. Nothing is written. Ctrl-C ends it.", err=True)
    with progress_view(quiet=quiet, title="", remaining=span(plan.expected)) as shown:
        yield update
