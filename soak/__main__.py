"""`python -m soak --for 5m`: the daemon for minutes to days on a bad line, with a dying broker and a port that goes.

Exit code 1 if a sample is lost, wrong or out of order, if a stale value looks live, or if the daemon grows.
`--exchanges 1000000` runs the family of bad lines in virtual time as well.
"""

from __future__ import annotations

import argparse
import logging
import secrets
import shutil
import sys
import tempfile
import time
from pathlib import Path

from lfs10d.schema.quantities import seconds as duration
from soak.family import Account, run_family
from soak.plan import steps
from soak.report import figures
from soak.run import Soak

SHORTEST = 10.0
LONGEST = 30 * 86400.0
SWITCH_INTERVAL = 1e-4
"""Seconds a thread may keep the others waiting: the simulated line has its time."""

PROGRESS_EVERY = 30.0
"""Seconds between two lines of the family in virtual time."""

SEEDS = 1 << 32


def span(text: str) -> float:
    """Return seconds of a duration such as 90s, 5m or 7d."""
    try:
        found = duration(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError("a duration such as 90s, 5m or 7d") from error
    if not SHORTEST <= found <= LONGEST:
        raise argparse.ArgumentTypeError("from 10s to 30d")
    return found


def tell(text: str) -> None:
    """Print a line at once."""
    print(text, flush=True)


def disturb(options: argparse.Namespace, folder: Path) -> list[str]:
    """Run the soak in real time, print the report, return what failed."""
    plan = [str(step) for step in steps(options.seed, options.length)]
    (folder / "plan.txt").write_text("\n".join(plan) + "\n")
    tell(f"seed {options.seed}; {len(plan)} disturbances, all in {folder / 'plan.txt'}")
    soak = Soak(folder, options.seed, options.length, tell)
    try:
        soak.run()
    except RuntimeError as error:
        return [str(error), *soak.failures]
    tell("")
    for what, much in figures(soak):
        tell(f"{what:30} {much}")
    return soak.failures


def run_virtual(options: argparse.Namespace) -> list[str]:
    """Run the family of bad lines in virtual time, print what it found, return what is wrong."""
    told = 0.0

    def progress(account: Account) -> None:
        nonlocal told
        if time.monotonic() - told > PROGRESS_EVERY:
            told = time.monotonic()
            tell(f"virtual time: {account.exchanges} exchanges, {account.findings} findings")

    logging.disable()  # of the daemon in this process: what it logs of faults by the thousand helps nobody
    account = run_family(options.exchanges, options.seed, progress)
    tell(str(account))
    return account.faults


def main() -> None:
    """Run and tell."""
    parser = argparse.ArgumentParser(prog="python -m soak", description=__doc__)
    parser.add_argument("--for", dest="length", type=span, default=300.0, metavar="TIME", help="10s to 30d (5m)")
    parser.add_argument("--seed", type=int, default=secrets.randbelow(SEEDS), help="repeats a soak (default: drawn)")
    parser.add_argument("--exchanges", type=int, default=0, help="of the family of bad lines in virtual time (0)")
    parser.add_argument("--keep", action="store_true", help="keep the folder of logs though nothing failed")
    options = parser.parse_args()
    sys.setswitchinterval(SWITCH_INTERVAL)
    folder = Path(tempfile.mkdtemp(prefix="lfs10d-soak-"))
    began = time.monotonic()
    failures = disturb(options, folder)
    if options.exchanges:
        failures += run_virtual(options)
    tell(f"\n{time.monotonic() - began:.0f} s")
    if failures:
        for failure in failures:
            print(failure, file=sys.stderr)
        exchanges = f" --exchanges {options.exchanges}" if options.exchanges else ""
        again = f"python -m soak --for {options.length:g}s --seed {options.seed}{exchanges}"
        sys.exit(f"{len(failures)} failures; logs and state are in {folder}; once more: {again}")
    tell("nothing lost, nothing wrong, nothing stale, nothing grown")
    if not options.keep:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
