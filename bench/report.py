"""The table: medians over the runs, for people on a terminal and as bench/RESULTS.md."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import statistics
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

from bench.measure import Run
from bench.rows import Row

Runs: TypeAlias = dict[tuple[str, str], list[Run]]
"""Runs by row and master."""

COLUMNS = (
    "row",
    "master",
    "runs",
    "polls/s",
    "of wire",
    "against",
    "slowest",
    "gap us min/p50/p99",
    "viol.",
    "CPU ms/1000",
    "x ref",
    "RSS/anon MB",
    "first ms",
    "to subscr. ms p50/p99",
    "jitter ms",
    "wrong/lost/holes",
)

EXPLAINED = """\
*of wire*: share of 1 / (request + t3.5 + turnaround + answer + t3.5). *against*: rate against the C reference on
the same line, or against the daemon's own row named. *slowest*: the slowest healthy sensor, against its fair part.
*viol.*: requests unheard for a gap below t3.5, a pause above t1.5, a wrong frame or rate, summed over the runs;
after the plus those that collided with an answer nobody could foresee. *x ref*: CPU per poll against the C reference
that publishes too. *first*: start of the process to the first good sample at an independent subscriber. *to subscr.*:
last byte of the answer on the wire to that subscriber. *jitter*: 99th percentile of the polls off their interval.
*wrong/lost/holes*: values that are not what that sensor sent, whole answers never published, holes in seq; summed.
"""


def median(values: Sequence[float | None]) -> float | None:
    """Return the median of what is there."""
    present = [value for value in values if value is not None]
    return statistics.median(present) if present else None


def number(value: float | None, digits: int = 1) -> str:
    """Write a number, or a dash."""
    return "-" if value is None else f"{value:.{digits}f}"


def against(row: Row, master: str, runs: Runs) -> str:
    """Write the rate against what the row is measured by, within the same run, median of the ratios."""
    other = (row.name, "reference") if row.against == "reference" else (row.against, "daemon")
    measured, measure = runs.get((row.name, master), []), runs.get(other, [])
    if master == "reference" or not measure:
        return "-"
    ratios = [run.rate / reference.rate for run, reference in zip(measured, measure, strict=False) if reference.rate]
    name = "" if row.against == "reference" else f" ({row.against})"
    return number(median(ratios), 3) + name


def line_of(row: Row, master: str, runs: Runs) -> list[str]:
    """Write one line of the table: medians over the runs of one master on one row."""
    mine = runs[row.name, master]
    reference = median([run.cpu_per_1000 for run in runs.get((row.name, "reference"), [])])
    cpu = median([run.cpu_per_1000 for run in mine])
    gaps = "/".join(number(median([run.gap_us[key] for run in mine]), 0) for key in ("min", "p50", "p99"))
    slowest = median([run.slowest / run.rate for run in mine if run.rate])
    latency = "/".join(number(median([run.latency.get(key) for run in mine])) for key in ("p50", "p99"))
    daemon = master == "daemon"
    return [
        row.title,
        master,
        str(len(mine)),
        number(median([run.rate for run in mine]), 2),
        number(median([run.share for run in mine]), 4),
        against(row, master, runs),
        number(slowest, 3),
        gaps,
        f"{sum(run.violations for run in mine)}+{sum(run.excused for run in mine)}",
        number(cpu),
        number(cpu / reference, 2) if cpu and reference else "-",
        f"{number(median([run.rss for run in mine]))}/{number(median([run.rss_anon for run in mine]))}",
        number(median([run.first_sample for run in mine]), 0),
        latency if daemon else "-",
        number(median([run.jitter for run in mine])),
        "/".join(str(sum(getattr(run, key) for run in mine)) for key in ("wrong", "lost", "holes")) if daemon else "-",
    ]


def table(rows: Sequence[Row], runs: Runs) -> list[list[str]]:
    """Return the whole table, head first."""
    lines = [line_of(row, master, runs) for row in rows for master in row.masters if runs.get((row.name, master))]
    return [list(COLUMNS), *lines]


def markdown(cells: list[list[str]]) -> str:
    """Write the table as markdown, aligned so that it reads well unrendered."""
    widths = [max(len(line[column]) for line in cells) for column in range(len(cells[0]))]
    lines = [
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) + " |" for line in cells
    ]
    lines.insert(1, "| " + " | ".join("-" * width for width in widths) + " |")
    return "\n".join(lines)


def machine() -> str:
    """Say what the bench ran on."""
    model = next(
        (
            line.split(":", 1)[1].strip()
            for line in Path("/proc/cpuinfo").read_text().splitlines()
            if line.startswith("model name")
        ),
        platform.machine(),
    )
    return f"{os.cpu_count()} x {model}, Linux {platform.release()}, Python {platform.python_version()}"


def versions() -> str:
    """Name the versions that matter."""
    names = ("lfs10d", "pymodbus", "paho-mqtt", "pydantic")
    return ", ".join(f"{name} {importlib.metadata.version(name)}" for name in names)


def revision() -> str:
    """Name the commit measured."""
    found = subprocess.run(["git", "describe", "--always", "--dirty"], capture_output=True, text=True, check=False)
    return found.stdout.strip() or "no commit"


def results(rows: Sequence[Row], runs: Runs, when: str) -> str:
    """Write bench/RESULTS.md."""
    pace = max(run.pace_p99_us for each in runs.values() for run in each)
    return (
        "# Results of the bench\n\n"
        f"Written by `make bench` on {when}; {revision()}.\n\n"
        f"{machine()}; {versions()}; load before: {os.getloadavg()[0]:.2f}. Medians of the runs, masters in turn.\n"
        f"The line's own bytes were late by at most {pace:.0f} us (99th percentile of the worst run).\n\n"
        f"{markdown(table(rows, runs))}\n\n{EXPLAINED}"
    )
