"""`lfs10d demo`: everything at work, without hardware and without set-up."""

from __future__ import annotations

import click

from lfs10d.cli import event_loop
from lfs10d.schema.quantities import seconds

EXAMPLES = """\b
Examples:
  lfs10d demo                        until Ctrl-C
  lfs10d demo --for 10s | cat        ten seconds of it, as plain lines
  lfs10d demo --broker amqtt         with the broker that comes with Python
"""


def _duration(context: click.Context, parameter: click.Parameter, value: str | None) -> float | None:
    """Return the seconds of text such as 10s."""
    try:
        return None if value is None else seconds(value)
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is no duration; write 10s or 2m", context, parameter) from error


@click.command("demo", epilog=EXAMPLES)
@click.option("--for", "duration", callback=_duration, metavar="DURATION", help="End after so long. Default: never.")
@click.option(
    "--broker",
    type=click.Choice(["auto", "mosquitto", "amqtt"]),
    default="auto",
    show_default=True,
    help="auto is mosquitto where it is installed.",
)
def command(duration: float | None, broker: str) -> int:
    """See it all at work: a simulated line of eight sensors, the daemon, a broker, and a live table from MQTT.

    One sensor is silent, one is noisy. The broker listens on this machine only. Ends with Ctrl-C and leaves
    nothing behind.
    """
    try:
        from lfs10d.cli.demo.runner import show  # noqa: PLC0415  # so that Ctrl-C is heard from here on

        event_loop.run(show(duration=duration, wanted=broker))
    except KeyboardInterrupt:  # before, or after, the loop listens to signals
        pass
    return 0
