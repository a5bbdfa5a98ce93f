"""`lfs10d doctor`: looks at everything between the sensor and the dashboard, and says what to do."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import click

from lfs10d.cli import EXIT_FAILED, config_option, event_loop, examples, json_option, print_lines, state_option
from lfs10d.cli.login import login_options

EXAMPLES = examples("""
  sudo lfs10d doctor              the service's line, with all that root sees
  lfs10d doctor -c site.yaml      another one
  lfs10d doctor --json            for programs
""")


@click.command("doctor", epilog=EXAMPLES)
@config_option
@state_option
@login_options
@json_option
def command(
    config: Path, state_dir: Path | None, username: str | None, password_file: Path | None, *, as_json: bool
) -> int:
    """Look at program, configuration, port, broker, clock, disk, service and sensors, and say what to do.

    A running daemon is asked how its sensors are; without one the sensors are read directly. Nothing is changed. Exit
    code 1 if something failed, 0 with warnings alone.
    """
    from lfs10d.cli.doctor import rounds  # noqa: PLC0415  # so that --help is quick
    from lfs10d.cli.doctor.finding import lines, summary  # noqa: PLC0415

    findings = event_loop.run(rounds.examine(config, state_dir, username, password_file))
    if as_json:
        click.echo(json.dumps([asdict(each) for each in findings], indent=2))
    else:
        print_lines(lines(findings))
        click.echo(summary(findings))
    return EXIT_FAILED if any(each.level == "fail" for each in findings) else 0
