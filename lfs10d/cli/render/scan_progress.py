"""The progress of a scan on standard error: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

import click

from lfs10d.cli.render import scan_findings

if TYPE_CHECKING:  # rich is imported where something is drawn, and nowhere else
    from rich.progress import Progress as Bar

    from lfs10d.line.jobs.identification import FoundDevice
    from lfs10d.line.jobs.scan import Scan

REPORT_EVERY = 10.0
"""Percent between two lines where no bar can be drawn."""


class ScanView(Protocol):
    """Shows how far a scan is."""

    def update(self) -> None:
        """Show what is new."""


@contextmanager
def view(scan: Scan, port: str, *, quiet: bool) -> Iterator[ScanView]:
    """Give what shows the scan; `quiet`: only on a terminal, where it leaves nothing behind."""
    terminal = sys.stderr.isatty()
    if not (quiet and not terminal):
        click.echo(announcement(scan, port), err=True)
    if not terminal:
        yield _ProgressLines(scan, quiet=quiet)
        return
    bar = progress_bar()
    with bar:
        yield _ProgressBar(scan, bar)


def announcement(scan: Scan, port: str) -> str:
    """Return what is about to happen and how long it takes."""
    search = scan.plan
    rates = " and ".join(str(timing.baudrate) for timing in search.timings)
    ids = f"id {search.ids[0]}" if len(search.ids) == 1 else f"{len(search.ids)} ids"
    return f"Scanning {port}: {ids} at {rates} baud, about {span(search.expected)}. Nothing is written. Ctrl-C ends it."


def span(seconds: float) -> str:
    """Return a duration as people say it: `4 s`, `1 min 5 s`."""
    whole = max(1, round(seconds))
    minutes, rest = divmod(whole, 60)
    if not minutes:
        return f"{whole} s"
    return f"{minutes} min {rest} s" if rest else f"{minutes} min"


class _NewFindings:
    """Yields each finding once."""

    def __init__(self, scan: Scan) -> None:
        self._scan = scan
        self._reported: set[tuple[int, int]] = set()

    def fresh(self) -> Iterator[FoundDevice]:
        """Yield what was found since the last call."""
        for finding in self._scan.found:
            key = finding.slave, finding.baudrate
            if key not in self._reported:
                self._reported.add(key)
                yield finding


def _sentence(finding: FoundDevice) -> str:
    return f"found {finding.slave} at {finding.baudrate} baud: {scan_findings.what(finding)}"


class _ProgressLines:
    def __init__(self, scan: Scan, *, quiet: bool) -> None:
        self._scan = scan
        self._quiet = quiet
        self._new = _NewFindings(scan)
        self._next = REPORT_EVERY

    def update(self) -> None:
        """Print a line for each finding, and one now and then."""
        if self._quiet:
            return
        for finding in self._new.fresh():
            click.echo(_sentence(finding), err=True)
        progress = self._scan.progress
        if self._next <= progress.percent < 100.0:  # noqa: PLR2004  # of a hundred percent
            self._next = progress.percent + REPORT_EVERY
            click.echo(f"{progress.percent:.0f} %, about {span(progress.remaining)} to go", err=True)


class _ProgressBar:
    def __init__(self, scan: Scan, bar: Bar) -> None:
        self._scan = scan
        self._bar = bar
        self._new = _NewFindings(scan)
        self._task = bar.add_task("", total=100.0, remaining=span(scan.plan.expected))

    def update(self) -> None:
        """Move the bar; put each finding above it."""
        for finding in self._new.fresh():
            self._bar.console.print(_sentence(finding), markup=False, highlight=False)
        progress = self._scan.progress
        where = f"{progress.baudrate} baud, id {progress.slave:>3}"
        self._bar.update(
            self._task,
            completed=progress.percent,
            description=where,
            remaining=span(progress.remaining),
            refresh=True,
        )


def progress_bar() -> Bar:
    """Return a bar for standard error; what adds a task gives it `remaining`, in words."""
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
