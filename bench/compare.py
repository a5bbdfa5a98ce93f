"""`python -m bench.compare OTHER`: the same rows by two daemons in turn, and the ratio of their medians.

OTHER is the command of another version's daemon, for example /elsewhere/.venv/bin/lfs10d. A machine is never the same
twice: only what ran in turn can be compared.
"""

from __future__ import annotations

import argparse
import shlex
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeAlias

from bench.broker import Broker
from bench.masters import DAEMON
from bench.measure import Run, measure
from bench.report import markdown, median, number
from bench.rows import ROWS

FIRST_ROWS = ("1hz", "9600", "115200", "idle")
FIGURES: Sequence[tuple[str, int, Callable[[Run], float | None]]] = (
    ("CPU % of a core", 3, lambda run: run.core * 100),
    ("CPU ms/1000", 1, lambda run: run.cpu_per_1000 if run.rate else None),
    ("polls/s", 2, lambda run: run.rate),
    ("RSS MB", 1, lambda run: run.rss),
    ("first ms", 0, lambda run: run.first_sample),
    ("p50 ms", 2, lambda run: run.latency.get("p50")),
    ("p99 ms", 2, lambda run: run.latency.get("p99")),
    ("gap us min", 0, lambda run: run.gap_us["min"]),
    ("gap us p50", 0, lambda run: run.gap_us["p50"]),
)

Sides: TypeAlias = dict[str, list[Run]]
"""Runs of one row, by `this` and `other`."""


def line_of(title: str, sides: Sides) -> list[str]:
    """Write a row: of each figure both medians and this one's as a share of the other's."""
    cells = [title]
    for _, digits, figure in FIGURES:
        mine, others = (median([figure(run) for run in sides[side]]) for side in ("this", "other"))
        ratio = number(mine / others, 3) if mine is not None and others else "-"
        cells.append(f"{number(mine, digits)} : {number(others, digits)} = {ratio}")
    for side in ("this", "other"):
        runs = sides[side]
        counted = (sum(getattr(run, key) for run in runs) for key in ("violations", "wrong", "lost", "holes"))
        cells.append("/".join(map(str, counted)))
    return cells


def table(rows: dict[str, Sides]) -> str:
    """Write all rows, by title."""
    head = ["row", *(name for name, _, _ in FIGURES), "viol./wrong/lost/holes", "of the other"]
    return markdown([head, *(line_of(title, sides) for title, sides in rows.items())])


def main() -> None:
    """Measure and tell."""
    parser = argparse.ArgumentParser(prog="python -m bench.compare", description=__doc__)
    parser.add_argument("other", help="command of the other daemon")
    parser.add_argument("--this", help="command of this one (default: lfs10d beside this Python)")
    parser.add_argument("--rows", default=",".join(FIRST_ROWS), help="names (default: %(default)s)")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--seconds", type=float, help="length of a run, instead of the row's own")
    parser.add_argument("--warm", type=float, help="s from the start of a daemon to that of the run")
    options = parser.parse_args()
    commands = {"this": tuple(shlex.split(options.this)) if options.this else DAEMON}
    commands["other"] = tuple(shlex.split(options.other))
    known = {row.name: row for row in ROWS}
    rows = [known[name] for name in options.rows.split(",")]
    done: dict[str, Sides] = {row.title: {"this": [], "other": []} for row in rows}
    with tempfile.TemporaryDirectory(prefix="lfs10d-bench-") as folder, Broker(Path(folder)) as broker:
        for number_of_run in range(options.runs):
            for row in rows:
                lasting = row.lasting(options.seconds, warm=options.warm)
                for side in ("this", "other") if number_of_run % 2 else ("other", "this"):
                    run = measure(lasting, "daemon", broker.port, commands[side])
                    done[row.title][side].append(run)
                    print(
                        f"run {number_of_run + 1}: {row.title}, {side}: {run.core:.3%} of a core, {run.rate:.2f}/s, "
                        f"{run.violations} violations",
                        file=sys.stderr,
                    )
    print(table(done))


if __name__ == "__main__":
    main()
