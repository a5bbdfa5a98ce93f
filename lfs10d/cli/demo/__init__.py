"""`lfs10d demo`: simulated line, broker, daemon and live view, without hardware or set-up."""

from __future__ import annotations

import click

from lfs10d.cli import event_loop, examples
from lfs10d.cli.options import DurationType

EXAMPLES = examples("""
  lfs10d demo                        until Ctrl-C
  lfs10d demo --for 10s | cat        ten seconds, as plain lines
  lfs10d demo --broker amqtt         with the broker that comes with Python
""")


@click.command("demo", epilog=EXAMPLES)
@click.option("--for", "duration", type=DurationType("10s or 2m"), help="End after this time. Default: never.")
@click.option(
    "--broker",
    type=click.Choice(["auto", "mosquitto", "amqtt"]),
    default="auto",
    help="auto: mosquitto where it is installed, else amqtt.",
)
def command(duration: float | None, broker: str) -> int:
    """Show everything at work: eight sensors on a simulated line, the daemon, a broker, and a live table from MQTT.

    One sensor is silent, one is noisy. The broker listens on this machine only. Ctrl-C ends it; nothing
    is left behind.
    """
    try:
        from lfs10d.cli.demo.runner import show  # noqa: PLC0415  # so that Ctrl-C is heard from here on

        event_loop.run(show(duration=duration, wanted=broker))
    except KeyboardInterrupt:  # before, or after, the loop listens to signals
        pass
    return 0
