"""`python -m bench`: run the rows, print the table, write bench/RESULTS.md."""

from __future__ import annotations

import argparse
import datetime as dt
import shlex
import sys
import tempfile
from pathlib import Path

from bench.broker import Broker
from bench.masters import DAEMON
from bench.measure import measure
from bench.programs import HERE
from bench.report import Runs, markdown, results, table
from bench.rows import FIRST_ROWS, ROWS, Row


def chosen(options: argparse.Namespace) -> tuple[Row, ...]:
    """Return the rows asked for; rows that others are measured against come first, as listed."""
    known = {row.name: row for row in ROWS}
    if options.rows:
        names = options.rows.split(",")
        unknown = [name for name in names if name not in known]
        if unknown:
            sys.exit(f"no row named {', '.join(unknown)}; there are: {', '.join(known)}")
        names += [known[name].against for name in names if known[name].against in known]
        return tuple(row for row in ROWS if row.name in names)
    if options.quick:
        return tuple(row for row in ROWS if row.name in FIRST_ROWS)
    return ROWS


def run_rows(rows: tuple[Row, ...], options: argparse.Namespace) -> tuple[Runs, list[str]]:
    """Measure each row by each master in turn, the whole again for each run; return what failed, too."""
    runs: Runs = {}
    failures = []
    daemon = tuple(shlex.split(options.daemon)) if options.daemon else DAEMON
    turns = [(row, master) for row in rows for master in row.masters]
    with tempfile.TemporaryDirectory(prefix="lfs10d-bench-") as folder, Broker(Path(folder)) as broker:
        for number in range(1, 1 + max(options.runs or row.runs for row in rows)):
            for row, master in turns:
                if number > (options.runs or row.runs):
                    continue
                told = f"run {number}: {row.title}, {master}"
                try:
                    run = measure(row, master, broker.port, daemon)
                except RuntimeError as error:
                    failures.append(f"{told}: {error}")
                    print(failures[-1], file=sys.stderr)
                    continue
                runs.setdefault((row.name, master), []).append(run)
                print(
                    f"{told}: {run.rate:.2f}/s, {run.share:.4f} of the wire, {run.violations} violations",
                    file=sys.stderr,
                )
    return runs, failures


def main() -> None:
    """Measure and tell."""
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    parser.add_argument("--rows", help="names, like 9600,noise (default: all)")
    parser.add_argument("--quick", action="store_true", help=f"only {', '.join(FIRST_ROWS)}")
    parser.add_argument("--runs", type=int, help="of each row (default: 5 of the first three, 2 of the others)")
    parser.add_argument("--seconds", type=float, help="length of a run, instead of the row's own")
    parser.add_argument("--daemon", help="command of the daemon (default: lfs10d beside this Python)")
    parser.add_argument("--no-write", action="store_true", help="print only; leave bench/RESULTS.md alone")
    options = parser.parse_args()
    rows = chosen(options)
    if options.seconds:
        rows = tuple(row.lasting(options.seconds) for row in rows)
    runs, failures = run_rows(rows, options)
    print(markdown(table(rows, runs)))
    if failures:
        sys.exit(f"{len(failures)} runs failed; bench/RESULTS.md is left as it was")
    if not options.no_write:
        when = dt.datetime.now(dt.UTC).date().isoformat()
        page = HERE / "RESULTS.md"
        _, heading, others = page.read_text().partition("\n## ")  # what other programs measured stays
        page.write_text(results(rows, runs, when) + heading + others)


if __name__ == "__main__":
    main()
