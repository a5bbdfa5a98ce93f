"""`lfs10d check`: validates the configuration and computes the time budget of the line."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from lfs10d.cli import EXIT_CONFIG, EXIT_UNAVAILABLE, config_option, event_loop, examples, json_option, print_lines
from lfs10d.cli.advice import advice
from lfs10d.cli.doctor.finding import Finding, lines
from lfs10d.cli.render.table import columns
from lfs10d.config.loader import LoadedConfig, load
from lfs10d.errors import ConfigError, Problem
from lfs10d.line.budget import Budget, budget
from lfs10d.schema.quantities import duration_text
from lfs10d.system.logs import escape

EXAMPLES = examples("""
  lfs10d check                      the file of the service
  lfs10d check -c site.yaml         another one
  lfs10d check -c site.yaml --json  for programs
  lfs10d check --online             also look at port and broker
""")


@click.command("check", epilog=EXAMPLES)
@config_option
@click.option("--online", is_flag=True, help="Also look at the port and the broker.")
@json_option
def command(config: Path, *, online: bool, as_json: bool) -> int:
    """Validate the configuration; print the line's time budget.

    Every problem is one line FILE:LINE:COLUMN: key: what is wrong, on standard error. Exit code 78 with problems,
    0 without; warnings change nothing. With --online it is 69 if port or broker cannot be used now.
    """
    try:
        loaded = load(config)
    except ConfigError as error:
        if not as_json:
            raise
        click.echo(json.dumps({"valid": False, "problems": [asdict(problem) for problem in error.problems]}, indent=2))
        click.echo(str(error), err=True)
        return EXIT_CONFIG
    found = budget(loaded.config, loaded.profiles)
    warnings = advice(loaded, found, socket.gethostname())
    seen = _look(config, loaded) if online else []
    if as_json:
        report = _report(loaded, found, warnings) | ({"online": [asdict(each) for each in seen]} if online else {})
        click.echo(json.dumps(report, indent=2, allow_nan=False))
    else:
        print_lines(map(escape, _lines(loaded, found)))
        print_lines(lines(seen))
    print_lines((escape(str(warning)) for warning in warnings), err=True)
    return EXIT_UNAVAILABLE if any(each.level == "fail" for each in seen) else 0


def _look(config: Path, loaded: LoadedConfig) -> list[Finding]:
    """Return the findings about the port and the broker now."""
    from lfs10d.cli.doctor import rounds  # noqa: PLC0415  # the broker's client takes a third of a second

    return event_loop.run(rounds.port_and_broker(config, loaded))


def _report(loaded: LoadedConfig, found: Budget, warnings: tuple[Problem, ...]) -> dict[str, Any]:
    certificates = {
        slave.name: {name: entry.model_dump() for name, entry in slave.calibration.items()}
        for slave in loaded.config.slaves
    }
    return {
        "valid": True,
        "warnings": [asdict(warning) for warning in warnings],
        "budget": {
            "gap_us": round(found.gap * 1e6, 1),
            "load_pct": round(found.load * 100, 2),
            "load_with_turnaround_pct": round(found.load_with_turnaround * 100, 2),
            "shortest_cycle_s": round(found.shortest_cycle, 6),
            "slowest_cycle_s": round(found.slowest_cycle, 6),
            "slaves": [
                {
                    "name": share.device,
                    "id": share.slave,
                    "profile": share.profile,
                    "interval": share.interval,
                    "exchanges": share.exchanges,
                    "wire_ms": round(share.wire * 1e3, 3),
                    "longest_wire_ms": round(share.longest_wire * 1e3, 3),
                    "rest_ms": round(share.rest * 1e3, 3),
                    "load_pct": None if share.load is None else round(share.load * 100, 3),
                    "calibration": certificates[share.device],
                }
                for share in found.shares
            ],
        },
        "line": loaded.config.line.name,
    }


def _lines(loaded: LoadedConfig, found: Budget) -> Iterator[str]:
    line, mqtt = loaded.config.line, loaded.config.mqtt
    character = f"{line.databits}{line.parity[0].upper()}{line.stopbits}"
    yield f"{loaded.path}: valid"
    yield f"line    {line.name}: {line.port}, {line.baudrate} baud {character} {line.framing}"
    yield f"broker  {mqtt.broker}, topics below {mqtt.base_topic}/{line.name}"
    disabled = sum(not slave.enabled for slave in loaded.config.slaves)
    yield f"slaves  {len(loaded.config.slaves)}" + (f", {disabled} of them disabled" if disabled else "")
    yield ""
    if not found.shares:
        return
    rests = any(share.rest for share in found.shares)
    slow = any(share.longest_wire > share.wire for share in found.shares)
    heads = ("wire time", *(["with slow values"] if slow else []), *(["rest"] if rests else []), "load")
    yield from columns(
        ("device", "id", "profile", "interval", *heads),
        [
            (
                share.device,
                str(share.slave),
                share.profile,
                duration_text(share.interval) if share.interval else "0",
                f"{share.wire * 1e3:.1f} ms",
                *([f"{share.longest_wire * 1e3:.1f} ms"] if slow else []),
                *([f"{share.rest * 1e3:.1f} ms"] if rests else []),
                "the rest" if share.load is None else f"{share.load:.1%}",
            )
            for share in found.shares
        ],
        right=(1, 3, 4, 5, 6, 7),
    )
    yield ""
    calibrated = [
        (slave.name, name, f"value * {entry.scale:.10g} {'-' if entry.offset < 0 else '+'} {abs(entry.offset):.10g}")
        for slave in loaded.config.slaves
        for name, entry in slave.calibration.items()
    ]
    if calibrated:
        yield from columns(("device", "value", "calibration"), calibrated)
        yield ""
    yield (
        f"load             {found.load:.1%} of the line if answers begin at once, "
        f"{found.load_with_turnaround:.1%} if each answer takes 5 ms to begin"
    )
    yield f"fastest cycle    {found.shortest_cycle * 1e3:.1f} ms to poll each once, if answers begin at once"
    yield f"slowest cycle    {found.slowest_cycle:.3g} s if every answer begins at the last moment"
    yield f"silence          {found.gap * 1e6:.0f} us before each request"
