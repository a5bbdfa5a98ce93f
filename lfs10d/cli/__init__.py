"""The command line: one file per verb, imported only when the verb is called."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import click

from lfs10d import __version__
from lfs10d.system import startup

EXIT_FAILED = 1
EXIT_UNAVAILABLE = 69
EXIT_CONFIG = 78
"""sysexits.h: EX_UNAVAILABLE, EX_CONFIG."""

ANY_FILE = click.Path(path_type=Path, readable=False)
"""An option's file; whether it can be read is reported in our words."""

SERVICE_FILE = Path("/etc/lfs10d/lfs10d.yaml")
"""The configuration that the service reads, and every verb that is given no other."""


def examples(lines: str) -> str:
    """Return the epilog of a help: these lines, as they are."""
    return f"\b\nExamples:{lines}"


VERBS = {
    "run": "Run the daemon.",
    "check": "Validate the configuration; print the line's time budget.",
    "config": "Print the effective configuration with the origin of each value.",
    "scan": "Find the devices on a line.",
    "read": "Read one sensor.",
    "request": "Send a request to the running daemon, print its response.",
    "watch": "Show a live table of all slaves.",
    "trace": "Show the frames on the line, decoded.",
    "profiles": "Show the device profiles.",
    "simulate": "Run a simulated line on a pseudo terminal.",
    "demo": "Show it at work: simulated line, broker, daemon, live view.",
    "web": "Serve the live page and /metrics of one or more lines.",
    "metrics": "Print the figures for Prometheus once.",
    "doctor": "Look at everything from sensor to dashboard; say what to do.",
    "service": "Install, print or remove the systemd unit.",
}
"""Each has a module of its name with `command` in it; the short help stands here so that --help imports none."""

PLACES = {"web": "lfs10d.web.serve", "metrics": "lfs10d.web.print_metrics"}
"""Modules of verbs that are built on top of the others."""

EXAMPLES = examples("""
  lfs10d demo                  show it at work, without hardware
  lfs10d scan /dev/ttyUSB0     find the devices on a line
  lfs10d check -c lfs10d.yaml  validate the file and the time budget
  lfs10d run -c lfs10d.yaml    measure and publish
""")


class Verbs(click.Group):
    """Looks a verb's module up when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the verbs in the order of first use."""
        del ctx
        return [*VERBS]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the verb's module and return its command."""
        del ctx
        if cmd_name not in VERBS:
            return None
        command: click.Command = importlib.import_module(PLACES.get(cmd_name, f"{__name__}.{cmd_name}")).command
        startup.done()
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the verbs with their short help, importing none of them."""
        del ctx
        with formatter.section("Verbs"):
            formatter.write_dl([*VERBS.items()])


@click.command(
    cls=Verbs,
    name="lfs10d",
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
    epilog=EXAMPLES,
)
@click.version_option(__version__, prog_name="lfs10d", message="%(prog)s %(version)s")
def lfs10d() -> None:
    """Poll Modbus wind sensors on one RS485 line and publish them over MQTT.

    Every verb has its own help: lfs10d VERB --help.
    """


def config_option(function: Callable[..., Any], text: str = "The configuration file.") -> Callable[..., Any]:
    """Add `-c FILE`, passed on as `config: Path`; `text` is its help."""
    return click.option(
        "-c",
        "--config",
        envvar="LFS10D_CONFIG",
        show_envvar=True,
        default=SERVICE_FILE,
        metavar="FILE",
        type=ANY_FILE,
        help=text,
    )(function)


def state_option(
    function: Callable[..., Any], text: str = "Where the daemon keeps state. Default: as `lfs10d run` has it."
) -> Callable[..., Any]:
    """Add `--state-dir DIRECTORY`, passed on as `state_dir: Path | None`; `text` is its help."""
    return click.option("--state-dir", type=ANY_FILE, metavar="DIRECTORY", help=text)(function)


def json_option(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--json`, passed on as `as_json: bool`."""
    return click.option("--json", "as_json", is_flag=True, help="Print JSON for programs.")(function)


def printing_option(name: str, text: str, lines: Callable[[], Iterable[str]]) -> Callable[..., Any]:
    """Return a flag that prints these lines in place of what the verb does; `text` is its help."""

    def callback(context: click.Context, _: click.Parameter, wanted: bool) -> None:  # noqa: FBT001  # as click calls it
        if wanted and not context.resilient_parsing:
            print_lines(lines())
            context.exit()

    return click.option(name, is_flag=True, is_eager=True, expose_value=False, callback=callback, help=text)


def print_lines(lines: Iterable[str], *, err: bool = False) -> None:
    """Print each line as it comes, on standard error if `err`."""
    for line in lines:
        click.echo(line, err=err)
